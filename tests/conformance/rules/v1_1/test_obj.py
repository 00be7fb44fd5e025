"""Every rule on objects and the scene's time, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    CAMERA,
    OBJECT_POSE,
    Case,
    breaches,
    changed,
    client,
    first_breach,
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


@pytest.mark.parametrize(
    ("pointer", "value"),
    [
        ("/type", "ObjectPose"),
        ("/object", ""),
        ("/object", "o" * 65),
        ("/object", 7),
        ("/position", ...),
        ("/position/z", ...),
        ("/position/y", 1e39),
        ("/rotation/w", ...),
        ("/rotation/w", 0.9),
        ("/scale", 0),
        ("/scale", 0.0000009),
        ("/scale", 1000001),
        ("/scale", None),
        ("/scale", [1, 1, 1]),
    ],
)
def test_obj_1_covers_every_member(pointer: str, value: Any) -> None:
    broken = steers(changed(OBJECT_POSE, pointer, value))
    assert breaches(broken) == {("client", "OBJ-1"): 1}
    assert pointer.startswith(first_breach(broken).pointer)


def test_the_order_of_members_is_advice_for_poses_of_1_0_alone() -> None:
    turned = dict(reversed(OBJECT_POSE["rotation"].items()))
    assert breaches(steers({**OBJECT_POSE, "rotation": turned})) == {}


def test_a_timestamp_of_an_object_s_pose_is_one() -> None:
    assert breaches(steers({**OBJECT_POSE, "timestamp": "noon"})) == {("client", "POS-8"): 1}


def test_a_scale_may_be_left_out() -> None:
    assert breaches(steers(changed(OBJECT_POSE, "/scale"))) == {}


@pytest.mark.parametrize("time", [None, True, "noon", [1.5]])
def test_tim_1_wants_a_number(time: Any) -> None:
    assert breaches(steers({"type": "set_time", "time": time})) == {("client", "TIM-1"): 1}


@pytest.mark.parametrize(
    ("pointer", "value"),
    [
        ("/objects", None),
        ("/objects", {}),
        ("/objects", PLACED["objects"] * 257),
        ("/objects", PLACED["objects"] * 2),
        ("/objects/0", "chair"),
        ("/objects/0/object", ...),
        ("/objects/0/object", ""),
        ("/objects/0/position", ...),
        ("/objects/0/position", {"x": 0, "y": 0, "z": 0}),
        ("/objects/0/position/1", None),
        ("/objects/0/position/1", 1e39),
        ("/objects/0/rotation", [0.0, 0.0, 1.0]),
        ("/objects/0/rotation/3", 0.9),
        ("/objects/0/scale", 0),
        ("/objects/0/scale", None),
    ],
)
def test_obj_7_covers_every_member(pointer: str, value: Any) -> None:
    broken = lends(changed(PLACED, pointer, value))
    assert breaches(broken) == {("server", "OBJ-7"): 1}
    assert pointer.startswith(first_breach(broken).pointer)


def test_no_objects_are_as_good_as_an_empty_list() -> None:
    assert breaches(lends({**frame(), "objects": []})) == {}
