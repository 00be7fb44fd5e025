"""Cameras: tags and lenses."""

from typing import Any

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    CAMERA,
    HOST_INIT,
    INTRINSICS,
    POSE,
    Entry,
    Step,
    about_generation,
    changed,
    client,
    error,
    frame,
    greeting,
    ipc,
    joined,
    msg,
    server,
    session,
)

LENS = {**POSE, "intrinsics": INTRINSICS}
TAGGED = {**POSE, "tag": "7c1f-41"}
REPLY = {"type": "camera", **CAMERA, "intrinsics": {**INTRINSICS, "width": 64, "height": 48}}
PLAIN = changed(REPLY, "/intrinsics")
AGREED = greeting("intrinsics")
MEMORY = ipc(*greeting("host_shm"), server(HOST_INIT), start=0.5)
FIRST = (server(frame(1)), client(about_generation("release", seq=1)))
SECOND = client(about_generation("release", seq=2))


def answered(reply: dict, *agreed: Step) -> list[Entry]:
    return joined(MEMORY, msg(*agreed, client(ASK_CAMERA), server(reply)))


def shown(tag: Any = ..., pose: dict = TAGGED, seq: int = 2) -> Step:
    """A frame from where a pose put the camera."""
    at = {name: list(pose[name].values()) for name in ("position", "rotation")}
    named = {} if tag is ... else {"tag": tag}
    message = frame(seq)
    return server({**message, "camera": {**message["camera"], **at, **named}}, pause=1.0)


def steered(*poses: dict, seen: tuple[Step, ...], start: float = 1.0) -> list[Entry]:
    return joined(msg(*AGREED, *map(client, poses), start=start), session(*FIRST, *seen))


MOVED = changed(TAGGED, "/position/x", 2.0)
HERS = shown("7c1f-41")
TALKS = {
    "a lens": (msg(*AGREED, client(LENS)), ""),
    "other members of these names in 1.0": (
        msg(client({**POSE, "tag": 7, "intrinsics": "mine"})),
        "",
    ),
    "far before near": (
        msg(*AGREED, client(changed(LENS, "/intrinsics/far", 0.01))),
        "client:CAM-4",
    ),
    "a reply with the lens": (answered(REPLY, *AGREED), ""),
    "with half a lens": (answered(changed(REPLY, "/intrinsics/cx"), *AGREED), "server:CAM-4"),
    "of another size": (answered(changed(REPLY, "/intrinsics/width", 65), *AGREED), "CAM-8"),
    "without a lens": (answered(PLAIN, *AGREED), "CAM-8"),
    "before the size is known": (msg(*AGREED, client(ASK_CAMERA), server(PLAIN)), ""),
    "where none was agreed": (answered(PLAIN, *greeting()), ""),
    "the tag of a pose": (steered(TAGGED, seen=(HERS,)), ""),
    "no tag": (steered(TAGGED, seen=(shown(),)), "CAM-2"),
    "another tag": (steered(TAGGED, seen=(shown("other"),)), "CAM-2"),
    "no tag in the first image": (
        joined(msg(*AGREED, client(TAGGED)), session(shown(seq=1))),
        "",
    ),
    "a tag of nobody known": (
        steered(TAGGED, seen=(shown("other", changed(POSE, "/position/x", 9)),)),
        "",
    ),
    "a tag twice": (steered(TAGGED, seen=(HERS, SECOND, shown("7c1f-41", seq=3))), "CAM-3"),
    "a tag before its pose": (steered(TAGGED, seen=(HERS,), start=9.0), "!CAM-3"),
    "a tag of two poses": (
        steered(TAGGED, MOVED, seen=(HERS, SECOND, shown("7c1f-41", MOVED, 3))),
        "",
    ),
    "perhaps of the same pose without a tag": (
        steered(TAGGED, POSE, seen=(shown(),)),
        "!CAM-2",
    ),
    "perhaps another client has control": (
        joined(msg(*AGREED, client(TAGGED), server(error("busy"))), session(*FIRST, shown())),
        "!CAM-2",
    ),
    "no tag at all": (steered(POSE, seen=(shown(),)), "!CAM-2"),
}
