from splatbus_conformance.controls import CAMERA_REQUEST, VIEWPORT_REQUEST, are_answered, both, one

SIZE = {"viewport_size": [64, 48]}
CAMERA = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0]}
WELCOME = {"type": "welcome", "version": "1.1"}


def test_with_welcome_a_reply_is_told_by_its_id() -> None:
    request = one(WELCOME)
    (other,) = both(WELCOME)
    assert request["id"] != other["id"]
    for id in (None, other["id"], 7):
        assert not are_answered([request], [SIZE | {"id": id}])
    assert are_answered([request], [SIZE, SIZE | {"id": request["id"]}])


def test_without_one_a_reply_to_what_went_before_is_one_too_many() -> None:
    for welcome in (None, {"type": "welcome", "version": "1.0"}):
        requests = both(welcome)
        assert requests == [VIEWPORT_REQUEST, CAMERA_REQUEST]
        assert one(welcome) == VIEWPORT_REQUEST
        for before in ([], [SIZE], [CAMERA]):
            assert not are_answered(requests, [*before, SIZE])
            assert are_answered(requests, [*before, SIZE, CAMERA])
