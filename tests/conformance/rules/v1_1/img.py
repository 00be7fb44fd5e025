"""Frames, their release, and subscriptions."""

from tests.conformance.rules.talk import (
    ALL,
    HOST_INIT,
    OPENED,
    Step,
    about_generation,
    changed,
    client,
    frame,
    greeting,
    ipc,
    raw,
    server,
    session,
)


def release(seq: int = 1, generation: int = 1) -> Step:
    return client(about_generation("release", generation, seq=seq))


FIRST, SECOND_FRAME = server(frame(1)), server(frame(2, 2))
SECOND = server({**HOST_INIT, "generation": 2})
OPENED_2 = client(about_generation("opened", 2))
CLOSED = client(about_generation("closed"))
REFUSED = client(about_generation("open_failed", reason="no"))
NAMELESS = changed(frame(), "/seq", "first")
ANSWER = client(changed(about_generation("release", seq=1), "/seq", "first"))

TALKS = {
    "one after the other": (session(FIRST, release(1), server(frame(4)), release(4)), ""),
    "not growing": (session(FIRST, release(1), FIRST), "IMG-1"),
    "of a slot that is not there": (session(server({**frame(), "slot": 3})), "IMG-1"),
    "of another size": (session(server(changed(frame(), "/camera/width", 65))), "IMG-1"),
    "far before near": (session(server(changed(frame(), "/camera/far", 0.01))), "IMG-1"),
    "no unit rotation": (session(server(changed(frame(), "/camera/rotation/3", 2))), "IMG-1"),
    "two at once": (session(FIRST, server(frame(2))), "IMG-2"),
    "before the memory is open": (ipc(*greeting(*ALL), server(HOST_INIT), FIRST), "IMG-2"),
    "not agreed": (ipc(*greeting("host_shm"), server(HOST_INIT), OPENED, FIRST), "IMG-23"),
    "released twice": (session(FIRST, release(1), release(1)), "IMG-12"),
    "another one is released": (session(FIRST, release(2), server(frame(3))), "IMG-12 IMG-2"),
    "released without seq": (
        session(FIRST, client({"type": "release", "generation": 1})),
        "IMG-12",
    ),
    "released before closed": (session(FIRST, SECOND, OPENED_2, release(1), CLOSED), ""),
    "closed before released": (session(FIRST, SECOND, OPENED_2, CLOSED), "IMG-12"),
    "released after closed": (session(SECOND, OPENED_2, FIRST, CLOSED, release(1)), "IMG-12"),
    "on its way": (session(SECOND, FIRST, OPENED_2, CLOSED), ""),
    "of no slot": (session(server({**frame(), "slot": 3}), SECOND, OPENED_2, CLOSED), "IMG-1"),
    "after closed": (session(SECOND, OPENED_2, CLOSED, FIRST), ""),
    "a lease ends with closed": (session(FIRST, SECOND, OPENED_2, CLOSED, SECOND_FRAME), "IMG-12"),
    "a lease ends with open_failed": (
        session(FIRST, SECOND, OPENED_2, REFUSED, SECOND_FRAME),
        "OPN-1",
    ),
    "a frame that crossed closed": (session(SECOND, OPENED_2, CLOSED, FIRST, SECOND_FRAME), ""),
    "a frame twice": (session(FIRST, FIRST, release(1), release(1)), "IMG-1 IMG-2"),
    "a frame of no number": (session(server(NAMELESS), ANSWER), "IMG-1"),
    "what could not be split": (session(raw("s2c", b"\xff" * 8), release(1)), "server:FRM-2"),
    "a subscription": (session(client({"type": "subscribe", "channels": ["depth", "color"]})), ""),
}
