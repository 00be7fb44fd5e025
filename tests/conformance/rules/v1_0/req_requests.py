"""What a client asks."""

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CLIENT_ENDS,
    POSE,
    SIZE,
    client,
    greeting,
    hello,
    msg,
    server,
    welcome,
)

UNKNOWN_YET = server({"viewport_size": [0, 0]})
ASKS = client(ASK_SIZE)
WEATHER = client({"type": "weather"})
FUTURE = {**hello(), "versions": ["2.0", "1.1"]}
RESIZE = {"type": "set_viewport", "width": 640.0, "height": 480}

TALKS = {
    "a request of 1.1": (msg(*greeting("viewport"), client(RESIZE)), ""),
    "a request of 1.1 before hello": (msg(client({"type": "ping"})), "NEG-5"),
    "a type in other letters": (msg(client({"type": "getViewportSize"})), "REQ-1"),
    "no type, and meant as a request": (msg(client({"cam_idx": 0})), "REQ-2"),
    "no type that anything defines": (
        msg(*map(client, ({}, {"type": 5}, {"type": "get_viewport"}))),
        "REQ-14 REQ-14 REQ-14",
    ),
    "a type of a version that nobody knows": (
        msg(client(FUTURE), server({**welcome(), "version": "2.0"}), WEATHER),
        "",
    ),
    "asked again at once": (msg(ASKS, UNKNOWN_YET, client(ASK_SIZE, pause=0.05)), "REQ-12"),
    "asked again later": (msg(ASKS, UNKNOWN_YET, client(ASK_SIZE, pause=0.12)), ""),
    "asked ahead": (msg(ASKS, client(ASK_CAMERA), UNKNOWN_YET, ASKS), ""),
    "gave up waiting": (msg(ASKS, CLIENT_ENDS), ""),
    "waits for ever": (msg(ASKS, client(POSE, pause=16.0), client(POSE)), "CHN-15"),
    "waits for a while": (msg(ASKS, client(POSE, pause=14.0)), ""),
    "a spoiled reply": (msg(ASKS, server(b"{"), client(POSE, pause=20.0)), "server:JSN-1"),
    "a late reply": (msg(ASKS, client(POSE, pause=16.0), server(SIZE)), "CHN-15"),
}
