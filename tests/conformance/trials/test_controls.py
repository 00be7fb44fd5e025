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
    request = one(True)
    (other,) = both(True)
    assert request["id"] != other["id"]
    for id in (None, other["id"], 7):
        assert not are_answered([request], [SIZE | {"id": id}])
    assert are_answered([request], [SIZE, SIZE | {"id": request["id"]}])


def test_without_one_a_reply_to_what_went_before_is_one_too_many() -> None:
    requests = both(False)
    assert requests == [VIEWPORT_REQUEST, CAMERA_REQUEST]
    assert one(False) == VIEWPORT_REQUEST
    for before in ([], [SIZE], [CAMERA]):
        assert not are_answered(requests, [*before, SIZE])
        assert are_answered(requests, [*before, SIZE, CAMERA])


def test_a_request_that_is_not_answered_yet_is_not_the_control_too() -> None:
    asked = VIEWPORT_REQUEST | {"id": 5}
    assert one(False, [asked], []) == CAMERA_REQUEST
    assert one(False, [asked], [SIZE]) == VIEWPORT_REQUEST
    assert one(False, [asked, asked], [SIZE]) == CAMERA_REQUEST
    assert one(False, [CAMERA_REQUEST], []) == VIEWPORT_REQUEST
