"""What a server answers."""

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    CLIENT_ENDS,
    GREETING,
    INIT,
    POSE,
    SERVER_ENDS,
    SIZE,
    Step,
    changed,
    client,
    ends,
    error,
    frame,
    ipc,
    joined,
    msg,
    server,
    session,
)

ASKS, TELLS = client(ASK_SIZE), server(SIZE)
ASKS_CAMERA, TELLS_CAMERA = client(ASK_CAMERA), server(CAMERA)
SERVED = (ASKS, TELLS)
TYPED_SIZE = {"type": "viewport_size", **SIZE}
TYPED_CAMERA = {"type": "camera", **CAMERA}
UNKNOWN = client({"type": "later"})
NO_INDEX = {"type": "get_camera_pose"}
BUSY = server(error("busy"))
MEMORY = ipc(server(INIT), start=0.5)
WIDER = ipc(
    server({**INIT, "meta": {**INIT["meta"], "w": 128, "pitchColor": 2048, "pitchDepth": 512}}),
    start=3.0,
    conn=2,
)
RENDERED = session(server(frame()), BUSY, conn=3)


def told(size: object, start: float = 1.0) -> list:
    return msg(ASKS, server({"viewport_size": size}), start=start)


def typed(reply: dict) -> list:
    return msg(*GREETING, client({**ASK_SIZE, "id": 7}), server(reply))


def pipelined(*asked: Step, reply: Step = TELLS, times: int = 1) -> list:
    return msg(*asked, *[reply] * times)


TALKS = {
    "answers": (
        msg(*SERVED, client(POSE), ASKS_CAMERA, TELLS_CAMERA, CLIENT_ENDS, SERVER_ENDS),
        "",
    ),
    "half a size": (told([0, 48]), "REQ-4"),
    "a size with a fraction": (told([64.0, 48]), "REQ-3"),
    "a rotation that is none": (
        msg(ASKS_CAMERA, server(changed(CAMERA, "/rotation/3", 0.9))),
        "REQ-5",
    ),
    "no size before anything is rendered": (joined(MEMORY, told([0, 0])), ""),
    "no size after an image": (joined(RENDERED, told([0, 0], start=9.0)), "REQ-4"),
    "the size of an image to come": (joined(MEMORY, told([128, 48]), WIDER), ""),
    "the size of an image that has gone": (joined(MEMORY, WIDER, told([64, 48], 9.0)), "REQ-4"),
    "out of order": (msg(ASKS, ASKS_CAMERA, TELLS_CAMERA, TELLS), "REQ-7"),
    "out of order, after hello": (
        msg(*GREETING, ASKS, ASKS_CAMERA, server(TYPED_CAMERA), server(TYPED_SIZE)),
        "NEG-29",
    ),
    "twice": (msg(*SERVED, TELLS), "REQ-7"),
    "what was not asked for": (msg(ASKS, TELLS_CAMERA, SERVER_ENDS), "REQ-7"),
    "spoiled": (msg(ASKS, server(b"{"), SERVER_ENDS), "server:JSN-1"),
    "to nobody": (msg(server({"type": "news"}), server({"type": "welcome"})), "CHN-11 CHN-11"),
    "to a pose": (msg(client(POSE), server({"ok": True})), "POS-10"),
    "an error to a bad pose": (
        msg(
            *GREETING, client(changed(POSE, "/rotation/w", 2.0)), server(error("invalid_rotation"))
        ),
        "POS-3",
    ),
    "to a bad request": (msg(client(NO_INDEX), TELLS_CAMERA), "REQ-2 REQ-9"),
    "to a type unknown": (msg(UNKNOWN, TELLS_CAMERA), "REQ-14 REQ-8"),
    "a bad text among good ones": (
        pipelined(ASKS, client(b'{"type":"get_viewport_size",}'), ASKS, times=3),
        "client:JSN-1 server:JSN-8",
    ),
    "to a pose or a type unknown": (
        pipelined(client(POSE), UNKNOWN, ASKS, reply=server({"ok": True}), times=2),
        "REQ-14 REQ-3 REQ-7",
    ),
    "with the id of a bad request": (
        msg(
            *(*GREETING, client({**ASK_CAMERA, "id": 1}), client({**NO_INDEX, "id": 2})),
            *(server({**TYPED_CAMERA, "id": n}) for n in (1, 2)),
        ),
        "REQ-2 REQ-9",
    ),
    "without type": (typed({**SIZE, "id": 7}), "NEG-28"),
    "without id": (typed(TYPED_SIZE), "NEG-28"),
    "with another id": (typed({**TYPED_SIZE, "id": 8}), "NEG-28"),
    "the client ends, and one is missing": (
        msg(ASKS, ASKS_CAMERA, CLIENT_ENDS, TELLS, SERVER_ENDS),
        "CHN-16",
    ),
    "the server ends, and one is missing": (msg(*SERVED, ASKS_CAMERA, SERVER_ENDS), "REQ-7"),
    "the server ends after hello": (msg(*GREETING, ASKS_CAMERA, SERVER_ENDS), "NEG-29"),
    "the client reset": (msg(*SERVED, ASKS_CAMERA, ends("c2s", "reset"), SERVER_ENDS), ""),
    "never served": (msg(ASKS_CAMERA, SERVER_ENDS), ""),
    "told why": (msg(*GREETING, ASKS, server(error("too_many_clients")), SERVER_ENDS), ""),
    "the server ends for a bad request": (
        msg(*SERVED, client(NO_INDEX), ASKS_CAMERA, SERVER_ENDS),
        "REQ-2",
    ),
    "the server ends for a newer connection": (
        joined(
            msg(*SERVED, ASKS_CAMERA, Step("s2c", event="eof", pause=2.0)),
            msg(*SERVED, conn=2, start=2.0),
        ),
        "",
    ),
    "1.0 knows no ids": (
        msg(client({**ASK_SIZE, "id": {"of": "mine"}}), ASKS, TELLS, TELLS),
        "",
    ),
    "ids decide between requests": (
        msg(
            *(*GREETING, *(client({**ASK_SIZE, "id": n}) for n in (1, 2))),
            server({**TYPED_SIZE, "id": 2}),
        ),
        "NEG-29",
    ),
    "an id with a fraction of zero": (
        msg(*GREETING, client({**ASK_SIZE, "id": 3.0}), server({**TYPED_SIZE, "id": 3})),
        "",
    ),
    "none for a doubtful timestamp": (
        msg(*SERVED, client({**ASK_SIZE, "timestamp": "noon"}), SERVER_ENDS),
        "POS-8",
    ),
    "one for a doubtful timestamp": (
        msg(client({**ASK_SIZE, "timestamp": "noon"}), TELLS),
        "POS-8",
    ),
}
