"""The client's side of the negotiation."""

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    GREETING,
    HOST_INIT,
    INIT,
    INTRINSICS,
    OPENED,
    POSE,
    SIZE,
    about_generation,
    client,
    error,
    greeting,
    hello,
    ipc,
    msg,
    raw,
    server,
    session,
    welcome,
)

HELLO = client(hello(*ALL, *ALL_MSG))
FALLEN_BACK = (HELLO, client(ASK_SIZE), server(SIZE))
ASKS_0 = client({**ASK_SIZE, "id": 0})
TELLS_0 = server({"type": "viewport_size", **SIZE, "id": 0})
OTHER = client({**ASK_CAMERA, "id": 4})
RELEASE = client(about_generation("release", seq=1))
TAGGED = client({**POSE, "tag": "a"})
LENS = client({**POSE, "intrinsics": INTRINSICS})
GET_SCENE = client({"type": "get_scene"})
RUBBISH = {
    "no list of capabilities": (
        server({"type": "welcome", "capabilities": "all"}),
        "NEG-30 NEG-31",
    ),
    "no packet": (raw("s2c", b"GET / HTTP/1.1"), "server:FRM-2"),
}

TALKS = {
    "hello first": (msg(*GREETING), ""),
    "something before it": (msg(client(POSE), *GREETING), "NEG-1"),
    "rubbish before it": (msg(client(b"{"), *GREETING), "client:JSN-1"),
    "a second one": (msg(*GREETING, client(hello())), "NEG-3"),
    "1.1 before welcome": (ipc(HELLO, OPENED), "NEG-5"),
    "1.1 before welcome, on the other channel": (msg(HELLO, RELEASE), "NEG-5"),
    "1.1 without hello": (msg(RELEASE), "NEG-5"),
    "1.1 without hello, on the other channel": (ipc(RELEASE), "CHN-6"),
    "a member of 1.1 before welcome": (
        msg(HELLO, TAGGED, server(welcome(*ALL_MSG)), LENS),
        "NEG-5",
    ),
    "members of 1.1 without hello": (msg(TAGGED, LENS), ""),
    "a release that is not agreed": (session(RELEASE, capabilities=["host_shm"]), "NEG-5"),
    "a scene that is not agreed": (msg(*GREETING, GET_SCENE), "NEG-5"),
    "a lens that is not agreed": (msg(*GREETING, LENS), "NEG-5"),
    "what is agreed": (msg(*greeting("scene", "intrinsics"), GET_SCENE, LENS), ""),
    "goes on as 1.0 allows": (
        msg(*FALLEN_BACK, client(POSE), client(ASK_CAMERA), server(CAMERA)),
        "",
    ),
    "goes on with an id": (msg(*FALLEN_BACK, OTHER, server(CAMERA)), "NEG-13"),
    "goes on with a lens": (msg(*FALLEN_BACK, LENS), "NEG-13"),
    "an id before the reply arrives": (msg(HELLO, client(ASK_SIZE), OTHER, server(SIZE)), "NEG-5"),
    "memory of 1.0": (ipc(server(INIT), HELLO), ""),
    "memory of 1.0 is opened": (ipc(server(INIT), HELLO, OPENED), "NEG-14"),
    "a welcome that comes too late": (msg(*FALLEN_BACK, server(welcome()), ASKS_0), "NEG-6"),
    "memory of 1.0, then of 1.1": (
        ipc(server(INIT), *greeting(*ALL), server(HOST_INIT), OPENED),
        "MEM-1",
    ),
    "ids again": (msg(*GREETING, *(ASKS_0, TELLS_0) * 2, OTHER), ""),
    "an id that is in use": (msg(*GREETING, ASKS_0, OTHER, ASKS_0), "NEG-37"),
    "an id that an error gave back": (
        msg(*GREETING, ASKS_0, server(error("busy", id=0)), ASKS_0, TELLS_0),
        "",
    ),
    "an id that an error may have given back": (
        msg(*GREETING, ASKS_0, server(error("busy")), ASKS_0, TELLS_0),
        "",
    ),
    **{
        f"{what} from the server": (
            ipc(HELLO, rubbish, server(welcome(*ALL)), server(HOST_INIT), OPENED),
            broken,
        )
        for what, (rubbish, broken) in RUBBISH.items()
    },
}
