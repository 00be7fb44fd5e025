"""The server's side of the negotiation, and errors."""

from tests.conformance.rules.talk import (
    ALL,
    ASK_SIZE,
    CUDA_INIT,
    GREETING,
    HOST_INIT,
    POSE,
    SIZE,
    Step,
    client,
    error,
    hello,
    ipc,
    msg,
    server,
    welcome,
)

HELLO, WELCOME = client(hello(*ALL)), server(welcome(*ALL))
UNSUPPORTED = error("unsupported_version", supported=["2.0"])
UNAUTHORIZED, FULL, BUSY = map(error, ("unauthorized", "too_many_clients", "busy"))
BAD = client({**hello(), "versions": []})
UNREAD = client({**hello(), "x-later": float("inf")})
TO_1_0 = {**welcome(), "version": "1.0"}
TELLS = server({"type": "viewport_size", **SIZE})


def answers(*replies: dict, to: Step = HELLO) -> list:
    return ipc(to, *map(server, replies))


TALKS = {
    "a version that hello does not list": (answers({**welcome(), "version": "2.0"}), "NEG-6"),
    "a welcome to 1.0": (msg(client(hello()), server(TO_1_0), client(ASK_SIZE), server(SIZE)), ""),
    "a tag after that": (
        msg(client(hello()), server(TO_1_0), client({**POSE, "tag": "a"})),
        "NEG-5",
    ),
    "a reply before welcome": (
        msg(client(hello()), client(ASK_SIZE), TELLS, server(welcome())),
        "NEG-6",
    ),
    "memory of the host before welcome": (ipc(HELLO, server(HOST_INIT), WELCOME), "NEG-6"),
    "memory of CUDA before welcome": (ipc(HELLO, server(CUDA_INIT), WELCOME), ""),
    "a version in common is refused": (
        answers(error("unsupported_version", supported=["1.1"])),
        "NEG-6",
    ),
    "a good hello is refused": (answers(error("invalid_message")), "NEG-6"),
    "a bad hello is refused": (answers(error("invalid_message"), to=BAD), "NEG-2"),
    "a hello of bad text is refused": (
        answers(error("invalid_message"), to=UNREAD),
        "client:JSN-4",
    ),
    "one of two is refused": (
        ipc(UNREAD, BAD, server(error("unknown_type"))),
        "NEG-3 client:JSN-4",
    ),
    "more than hello lists": (
        ipc(client(hello("frames")), server(welcome("frames", "reinit"))),
        "NEG-7",
    ),
    "a capability of nobody": (
        ipc(client(hello("later")), server(welcome("later"))),
        "NEG-7 client:EVO-2",
    ),
    "one of the other channel": (msg(HELLO, server(welcome("frames"))), "NEG-7"),
    "a second welcome": (ipc(HELLO, WELCOME, WELCOME), "NEG-31"),
    "unsupported is not the end": (answers(UNSUPPORTED, BUSY), "NEG-10"),
    "unauthorized is all": (answers(UNAUTHORIZED), ""),
    "unauthorized after welcome": (answers(welcome(), UNAUTHORIZED), "NEG-18"),
    "unauthorized after memory": (
        ipc(server(CUDA_INIT), HELLO, server(UNAUTHORIZED)),
        "NEG-18",
    ),
    "an error without hello": (msg(server(BUSY)), "NEG-22"),
    "an error with an id of nobody": (msg(*GREETING, server(error("busy", id=9))), "NEG-23"),
    "three that close": (answers(FULL, FULL, FULL), "NEG-25 NEG-25"),
    "owns up to a defect": (answers(error("internal")), "NEG-41"),
}
