"""An init packet is taken or refused as the wire does it, and for the same requirement."""

import re
from itertools import product
from math import nextafter
from typing import Any

from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import check_fits, parse_init_packet

from tests.engines.built import Command, answers
from tests.wire.payloads import payload
from tests.wire.test_init_packet import BYTES, CUDA, HOST, LEGACY, NO_VERSIONS, with_value

PLACES = [
    *("/version", "/generation", "/meta", "/memory", "/ring", "/semantics"),
    *(f"/meta/{each}" for each in HOST["meta"]),
    *(f"/memory/{each}" for each in HOST["memory"]),
    *(f"/ring/{each}" for each in HOST["ring"]),
    *(f"/semantics/{each}" for each in HOST["semantics"]),
    *(f"/semantics/depth/{each}" for each in HOST["semantics"]["depth"]),
]
MORE_PLACES = ["/meta/offsetColor", "/meta/offsetDepth", "/meta/device", "/mem_color", "/later"]
INFINITE = 2.0**128 - 2.0**103
VALUES: list[Any] = [
    *(None, True, [], {}, "", "1", "inf", "1.2", "1.10", "a.b-c_D", "a" * 30, "a" * 31, ".a"),
    *("é", "straight", "premultiplied", "linear", "ray_distance", "median", "cuda_ipc"),
    *(0, 1, 2, 4, 8, 16, 32, 1024, 1025, 32_768, 32_769, -1, 0.5, 16.0, 1e39, 1e300),
    *(INFINITE, -INFINITE, nextafter(INFINITE, 0)),
    *(2**53 - 16, 2**53 - 1, 2**53, BYTES, BYTES - 1, [0, 0, 0], [0, 0, "0"]),
]


def refusal(message: dict[str, Any]) -> str:
    """The requirement for which the wire refuses it, or nothing."""
    try:
        packet = parse_init_packet(message)
        assert packet.memory is not None
        check_fits(packet, packet.memory.bytes)
    except ProtocolError as error:
        return error.requirement
    return ""


def test_any_value_in_any_place(program: Command) -> None:
    """Memory on a GPU alone is another matter: this client has not listed it."""
    messages = [with_value(HOST, *each) for each in product(PLACES + MORE_PLACES, VALUES)]
    messages += [with_value(HOST, each, ...) for each in PLACES]
    messages += [HOST | {"version": each} for each in NO_VERSIONS]
    judged = [each for each in messages if {"version", "meta"} <= each.keys()]
    told = answers(program, [payload(each) for each in judged])
    assert sum(each.startswith("taken") for each in told) > len(PLACES)
    for message, answer in zip(judged, told, strict=True):
        wanted = refusal(message)
        named = "".join(re.findall(r"\[([A-Z]{3}-\d+)\]", answer))
        if is_on_a_gpu(message):
            assert named
        else:
            assert (answer[:5] == "taken", named) == (not wanted, wanted), (message, answer)


def is_on_a_gpu(message: dict[str, Any]) -> bool:
    memory = message.get("memory")
    return isinstance(memory, dict) and memory.get("kind") == "cuda_ipc"


def test_a_server_of_1_0_and_memory_of_a_gpu(program: Command) -> None:
    old, gpu = answers(program, [payload(LEGACY), payload(CUDA)])
    assert old.startswith("taken")
    assert "'/memory/kind' is none of host_shm" in gpu
