"""Poses."""

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    CAMERA,
    POSE,
    SIZE,
    changed,
    client,
    msg,
    server,
)


def turned(norm: float) -> dict:
    return {**POSE, "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": norm}}


def at(*stamps: float) -> list:
    return msg(*(client(changed(POSE, "/timestamp", stamp)) for stamp in stamps))


TALKS = {
    "not a unit rotation": (msg(*map(client, map(turned, (0, 0.989, 1.011, 1e200)))), "POS-3 " * 4),
    "nearly a unit rotation": (msg(*map(client, map(turned, (0.9901, 1, 1.0099, -1)))), ""),
    "w first": (
        msg(client({**POSE, "rotation": {"w": 0.8, "x": 0.0, "y": 0.6, "z": 0.0}})),
        "POS-4",
    ),
    "no timestamp": (msg(client({**ASK_CAMERA, "timestamp": None})), "POS-8"),
    "a clock that was set back": (at(10.0, 11.0, 5.0, 6.0, 7.0), "POS-9"),
    "a number in a string that is too far": (
        msg(client(changed(POSE, "/position/x", "1e39"))),
        "POS-2 client:JSN-4",
    ),
    "numbers that are not finite": (
        msg(
            *(
                client(changed(changed(POSE, f"/{part}/x", float("-inf")), "/timestamp", value))
                for part in ("position", "rotation")
                for value in (float("inf"), "1e400")
            )
        ),
        "client:JSN-4 " * 4,
    ),
    "what a server sends is no pose": (
        msg(*map(server, ({"type": "camera_pose"}, SIZE, CAMERA))),
        "CHN-11 CHN-11 CHN-11",
    ),
}
