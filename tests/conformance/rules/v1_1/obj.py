"""Objects, and the scene's time."""

from tests.conformance.rules.talk import (
    CAMERA,
    OBJECT_POSE,
    changed,
    client,
    frame,
    greeting,
    msg,
    server,
    session,
)

CHAIR = {"object": "chair", **CAMERA}
AGREED = greeting("objects", "time")
SET_TIME = {"type": "set_time", "time": -1.5}
TURNED = {**OBJECT_POSE, "rotation": dict(reversed(OBJECT_POSE["rotation"].items()))}


def lends(*objects: dict) -> list:
    return session(server({**frame(), "objects": list(objects)}))


TALKS = {
    "another order, and a time": (msg(*AGREED, client(TURNED), client(SET_TIME)), ""),
    "no unit rotation": (msg(*AGREED, client(changed(OBJECT_POSE, "/rotation/w", 0))), "OBJ-1"),
    "no timestamp": (msg(*AGREED, client({**OBJECT_POSE, "timestamp": "noon"})), "POS-8"),
    "no objects in an image": (lends(), ""),
    "an object in an image": (lends({**CHAIR, "scale": 0.5}), ""),
    "one of no unit rotation": (lends({**CHAIR, "scale": 0.5, "rotation": [0, 0, 0, 2]}), "OBJ-7"),
    "one twice": (lends(*[{**CHAIR, "scale": 0.5}] * 2), "OBJ-7"),
}
