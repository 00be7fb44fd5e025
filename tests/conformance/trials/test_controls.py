"""No reply to what went before is taken for one to a control."""

from splatbus_conformance.trials.controls import (
    CAMERA_REQUEST,
    VIEWPORT_REQUEST,
    are_answered,
    both,
    one,
)

SIZE = {"viewport_size": [64, 48]}
CAMERA = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}


def test_where_ids_come_back_a_reply_is_told_by_its_id() -> None:
    request, (other,) = one(True), both(True)
    assert not are_answered([request], [SIZE, SIZE | {"id": other["id"]}])
    assert are_answered([request], [SIZE, SIZE | {"id": request["id"]}])


def test_without_one_what_is_owed_still_is_of_another_kind_than_the_control() -> None:
    assert both(False) == [VIEWPORT_REQUEST, CAMERA_REQUEST]
    for before in ([], [SIZE], [CAMERA]):
        assert not are_answered(both(False), [*before, SIZE])
        assert are_answered(both(False), [*before, SIZE, CAMERA])
    controls = [one(False, [VIEWPORT_REQUEST], heard) for heard in ([], [SIZE])]
    assert controls == [CAMERA_REQUEST, VIEWPORT_REQUEST]
