"""The replies that capabilities of 1.1 promise."""

from tests.conformance.rules.talk import (
    ASK_SIZE,
    PONG,
    SCENE,
    Step,
    about_generation,
    client,
    error,
    frame,
    greeting,
    joined,
    msg,
    server,
    session,
)

GET_SCENE = {"type": "get_scene"}
RESIZE = {"type": "set_viewport", "width": 640, "height": 480}
PING = {"type": "ping", "t": 12.5}
AGREED = greeting("scene", "viewport", "ping")
RELEASED = client(about_generation("release", seq=1))


def told(question: dict, answer: dict) -> list:
    return msg(*AGREED, client({**question, "id": 5}), server({**answer, "id": 5}))


def sized(*size: object) -> dict:
    return {"type": "viewport_size", "viewport_size": list(size)}


def pings(*times: float) -> list[Step]:
    return [step for t in times for step in (client(PING), server({**PONG, "serverTime": t}))]


def rendered(*times: float) -> list:
    first, second = (server({**frame(1 + i), "renderedAt": t}) for i, t in enumerate(times))
    return session(first, RELEASED, second)


def ponged(asked: float, back: float) -> list:
    return told({**PING, "t": asked}, {**PONG, "t": back})


RESIZED = (client(RESIZE), server(sized(640, 480)), client(ASK_SIZE))
WAITS = [
    entry._replace(t=entry.t + 1) if entry.t > 1.025 else entry
    for entry in msg(*AGREED, *pings(1040.75))
]
RENDERED = rendered(1040.5, 1041.0)

TALKS = {
    "a scene": (told(GET_SCENE, SCENE), ""),
    "an end before the beginning": (told(GET_SCENE, {**SCENE, "timeRange": [1, 0]}), "SCN-2"),
    "an object twice": (
        told(GET_SCENE, {**SCENE, "objects": SCENE["objects"] * 2}),
        "SCN-2",
    ),
    "an error for a scene": (told(GET_SCENE, error("busy")), "SCN-2"),
    "a defect for a scene": (told(GET_SCENE, error("internal")), "NEG-41"),
    "another size": (told(RESIZE, sized(640, 481)), "VPT-2"),
    "no size": (told(RESIZE, sized("a", 480)), "VPT-2"),
    "an error for a size": (told(RESIZE, error("busy")), ""),
    "a size that was granted": (
        joined(session(), msg(*AGREED, *RESIZED, server(sized(640, 480)), start=3.0)),
        "",
    ),
    "a size that was granted is forgotten": (
        joined(session(), msg(*AGREED, *RESIZED, server(sized(64, 48)), start=3.0)),
        "REQ-4",
    ),
    "another time": (ponged(12.5, 12.25), "PNG-2"),
    "an error for a ping": (told(PING, error("busy")), "PNG-2"),
    "the same double": (ponged(2**53 + 1, 2**53), ""),
    "clocks that go on": (
        joined(RENDERED, msg(*AGREED, *pings(1041.5, 1041.5), start=3.0)),
        "",
    ),
    "pongs that go back": (msg(*AGREED, *pings(1041.0, 1040.5)), "PNG-3"),
    "images that go back": (rendered(1041.0, 1040.5), "PNG-3"),
    "a pong behind an image": (joined(RENDERED, WAITS), "PNG-3"),
    "an image of before": (joined(RENDERED, msg(*AGREED, *pings(1040.75), start=3.0)), ""),
    "pings on their way": (
        msg(
            *(*AGREED, *(client({**PING, "id": i}) for i in range(2))),
            *(server({**PONG, "id": i, "serverTime": 2.0 - i}) for i in range(2)),
        ),
        "",
    ),
    "a ping that was not agreed": (
        msg(*greeting(), client({**PING, "id": 5}), server(error("unsupported", id=5))),
        "NEG-5 !PNG-2",
    ),
    "a broken ping": (
        msg(*AGREED, client({"type": "ping", "id": 5}), server(error("invalid_message", id=5))),
        "PNG-1 !PNG-2",
    ),
}
