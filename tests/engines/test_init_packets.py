"""An init packet is taken or refused as the wire does it, and for the same requirement."""

import re
from base64 import b64encode
from collections.abc import Iterator
from itertools import product
from math import nextafter
from typing import Any

from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import check_fits, parse_init_packet

from tests.engines.built import Command, answers, language_of
from tests.wire.payloads import payload
from tests.wire.test_init_packet import BYTES, CUDA, HOST, LEGACY, NO_VERSIONS, with_value

KNOWN = {"csharp": (HOST,), "cpp": (HOST, CUDA, LEGACY)}
"""What each client reads: the one in C# lists no memory of a GPU, and opens none of 1.0."""
MORE_PLACES = ["/meta/offsetColor", "/meta/offsetDepth", "/meta/device", "/mem_color", "/later"]
INFINITE = 2.0**128 - 2.0**103
HANDLE = b64encode(bytes(range(64))).decode()
VALUES: list[Any] = [
    *(None, True, [], {}, "", "1", "inf", "1.2", "1.10", "a.b-c_D", "a" * 30, "a" * 31, ".a"),
    *("é", "straight", "premultiplied", "linear", "ray_distance", "median", "cuda_ipc"),
    *(0, 1, 2, 4, 8, 16, 32, 1024, 1025, 32_768, 32_769, -1, 0.5, 16.0, 1e39, 1e300),
    *(INFINITE, -INFINITE, nextafter(INFINITE, 0)),
    *(2**53 - 16, 2**53 - 1, 2**53, BYTES, BYTES - 1, [0, 0, 0], [0, 0, "0"]),
    *(HANDLE, HANDLE[:-3] + "x==", HANDLE[:-2], HANDLE.replace("/", "_"), [HANDLE], [HANDLE] * 2),
    *("GPU-01234567-89ab-cdef-0123-456789abcdef", "GPU-01234567-89AB-cdef-0123-456789abcdef"),
    "GPU-01234567-89ab-cdef-0123-456789abcde",
]


def places(message: Any, at: str = "") -> Iterator[str]:
    """The JSON pointers of all that is in it."""
    inner = message.items() if isinstance(message, dict) else enumerate(message)
    for name, value in inner:
        yield f"{at}/{name}"
        if isinstance(value, dict | list):
            yield from places(value, f"{at}/{name}")


def refusal(message: dict[str, Any]) -> str:
    """The requirement for which the wire refuses it, or nothing."""
    try:
        packet = parse_init_packet(message)
        if packet.memory is not None:
            check_fits(packet, packet.memory.bytes)
    except ProtocolError as error:
        return error.requirement
    return ""


def test_any_value_in_any_place(program: Command) -> None:
    language = language_of(program)
    bases = KNOWN[language]
    messages = [
        with_value(base, *each)
        for base in bases
        for each in product([*places(base), *MORE_PLACES], VALUES)
    ]
    messages += [
        with_value(base, each, ...)
        for base in bases
        for each in places(base)
        if not each[-1].isdigit()
    ]
    messages += [base | {"version": each} for base in bases for each in NO_VERSIONS]
    judged = [each for each in messages if "meta" in each and is_known(language, each)]
    told = answers(program, [payload(each) for each in judged])
    assert sum(each.startswith("taken") for each in told) > len(list(places(HOST)))
    for message, answer in zip(judged, told, strict=True):
        wanted = refusal(message)
        named = "".join(re.findall(r"\[([A-Z]{3}-\d+)\]", answer))
        assert (answer[:5] == "taken", named) == (not wanted, wanted), (message, answer)


def is_known(language: str, message: dict[str, Any]) -> bool:
    memory = message.get("memory")
    is_on_a_gpu = isinstance(memory, dict) and memory.get("kind") == "cuda_ipc"
    return language == "cpp" or ("version" in message and not is_on_a_gpu)
