"""The init packet's members of 1.1."""

from tests.conformance.rules.talk import (
    ALL,
    CUDA_INIT,
    HANDLE,
    HOST_INIT,
    INIT,
    changed,
    greeting,
    ipc,
    server,
)

TURNS = {**HOST_INIT["ring"], "colorStride": 61440, "depthOffset": 49152, "depthStride": 61440}


def sends(*packets: dict, agreed: list[str] = ALL) -> list:
    return ipc(*greeting(*agreed), *map(server, packets))


TALKS = {
    "generations that grow": (sends(HOST_INIT, {**HOST_INIT, "generation": 2}), ""),
    "generations that do not": (sends(HOST_INIT, HOST_INIT), "MEM-1"),
    "a packet of 1.0 after welcome": (sends(INIT), "MEM-1"),
    "handles of 1.0": (sends({**HOST_INIT, "mem_color": HANDLE}), "MEM-3"),
    "a ring of CUDA": (sends(CUDA_INIT), ""),
    "without one, and without frames": (
        sends(changed(CUDA_INIT, "/ring"), agreed=["cuda_ipc"]),
        "",
    ),
    "without one": (sends(changed(CUDA_INIT, "/ring")), "MEM-8"),
    "an event less": (sends(changed(CUDA_INIT, "/ring/events/0")), "MEM-8"),
    "no handle of an event": (sends(changed(CUDA_INIT, "/ring/events/0", "x")), "INI-7"),
    "colour and depth by turns": (sends({**HOST_INIT, "ring": TURNS}), ""),
    "a byte beyond": (sends(changed(HOST_INIT, "/memory/bytes", 184319)), "MEM-9"),
    "overlapping": (sends({**HOST_INIT, "ring": {**TURNS, "depthOffset": 49136}}), "MEM-9"),
    "images that are longer than their stride": (
        sends(changed(HOST_INIT, "/ring/depthStride", 12272)),
        "MEM-8",
    ),
}
