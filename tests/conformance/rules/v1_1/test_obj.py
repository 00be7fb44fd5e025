"""Every rule on objects and the scene's time, kept and broken."""

from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    CAMERA,
    OBJECT_POSE,
    Case,
    breaches,
    changed,
    client,
    frame,
    greeting,
    server,
    session,
    talk,
)

SET_TIME = {"type": "set_time", "time": -1.5}
PLACED = {**frame(), "objects": [{"object": "chair", **CAMERA, "scale": 0.5}]}


def steers(message: dict) -> list[Entry]:
    return talk("msg", *greeting("objects", "time"), client(message))


def lends(message: dict) -> list[Entry]:
    return session(server(message))


CASES = [
    Case("OBJ-1", "client", steers(OBJECT_POSE), steers(changed(OBJECT_POSE, "/object"))),
    Case("TIM-1", "client", steers(SET_TIME), steers({"type": "set_time"})),
    Case("OBJ-7", "server", lends(PLACED), lends(changed(PLACED, "/objects/0/scale"))),
]


def test_the_order_of_members_is_advice_for_poses_of_1_0_alone() -> None:
    turned = dict(reversed(OBJECT_POSE["rotation"].items()))
    assert breaches(steers({**OBJECT_POSE, "rotation": turned})) == {}


def test_a_timestamp_of_an_object_s_pose_is_one() -> None:
    assert breaches(steers({**OBJECT_POSE, "timestamp": "noon"})) == {("client", "POS-8"): 1}


def test_a_scale_may_be_left_out() -> None:
    assert breaches(steers(changed(OBJECT_POSE, "/scale"))) == {}


def test_no_objects_are_as_good_as_an_empty_list() -> None:
    assert breaches(lends({**frame(), "objects": []})) == {}
