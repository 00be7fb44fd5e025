"""What goes beyond the versions that are spoken."""

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_SIZE,
    GREETING,
    HOST_INIT,
    POSE,
    SIZE,
    TELEMETRY,
    client,
    error,
    frame,
    greeting,
    hello,
    ipc,
    msg,
    server,
    session,
    welcome,
)

MARKER = {"type": "x-example-marker"}
GRANTED = greeting("ping", "x-example-markers")
LATER = {"later": 1}
WISH = client({"type": "subscribe_telemetry", "names": None})
FUTURE = hello("markers") | {"versions": ["1.2", "1.1"], **LATER}
LENS = frame(7)["camera"] | {"x-acme-note-2": {"any": 1}}
SERIES = [TELEMETRY["series"][0] | LATER]

TALKS = {
    "capabilities of nobody": (
        msg(client(hello("x-acme", "markers"))),
        "client:EVO-2",
    ),
    "a type of nobody, of the server": (msg(*GREETING, server({"type": "a"})), "server:EVO-2"),
    "what a vendor has": (msg(*GRANTED, client(MARKER), server(MARKER)), ""),
    "what a vendor has, and was not agreed": (
        msg(*GREETING, client(MARKER), server(MARKER)),
        "client:EVO-3 server:EVO-3",
    ),
    "that of another vendor": (msg(*greeting("x-other-a"), client(MARKER)), "client:EVO-3"),
    "before welcome": (msg(client(hello()), client(MARKER)), "client:EVO-3"),
    "members of vendors": (session(server(frame(7) | {"x-acme": 1, "camera": LENS})), ""),
    "a member of nobody": (msg(*GREETING, client(POSE | LATER)), "client:EVO-4"),
    "one within another": (
        ipc(*greeting(*ALL), server(HOST_INIT | {"ring": HOST_INIT["ring"] | LATER})),
        "server:EVO-4",
    ),
    "one in an item": (
        msg(*greeting(*ALL_MSG), WISH, server(TELEMETRY | {"series": SERIES})),
        "server:EVO-4",
    ),
    "one of an error": (msg(*GREETING, server(error("busy", **LATER))), "server:EVO-4"),
    "one in 1.0, after hello": (
        msg(client(hello()), client(ASK_SIZE), server(SIZE | LATER)),
        "",
    ),
    "one of a later version": (msg(client(FUTURE), server(welcome()), client(POSE | LATER)), ""),
}
