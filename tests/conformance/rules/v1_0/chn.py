"""Who sends what on which channel."""

from tests.conformance.rules.talk import (
    ADDED,
    ALL,
    CUDA_INIT,
    HOST_INIT,
    INIT,
    POSE,
    client,
    greeting,
    hello,
    ipc,
    server,
    session,
    welcome,
)

UNREADABLE = {**hello(), "capabilities": "host_shm"}
TALKS = {
    "nothing but an init packet": (ipc(server(INIT)), ""),
    "something before it": (ipc(server({"type": "news"}), server(INIT)), "CHN-4"),
    "a second one": (ipc(server(INIT), server(INIT)), "CHN-8"),
    "a client that talks without hello": (
        ipc(client(POSE), client({"type": "release"}), server(INIT)),
        "CHN-6 CHN-6",
    ),
    "memory of the host for who has not said hello": (ipc(server(HOST_INIT)), "CHN-5"),
    "memory of CUDA": (ipc(server({**CUDA_INIT, **ADDED})), ""),
    "memory of the host before hello": (ipc(server(HOST_INIT), *greeting(*ALL)), "NEG-11"),
    "memory of the host that nobody asked for": (
        ipc(*greeting("frames"), server(HOST_INIT)),
        "NEG-11",
    ),
    "what hello asks for cannot be read": (
        ipc(client(UNREADABLE), server(welcome()), server(HOST_INIT)),
        "NEG-2",
    ),
    "memory of CUDA before hello": (ipc(server(CUDA_INIT), *greeting("cuda_ipc")), ""),
    "other packets after hello": (
        session(server({"type": "x-example-note"}), capabilities=[*ALL, "x-example-notes"]),
        "",
    ),
}
