"""Every rule on the init packet's members of 1.1, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ALL,
    CUDA_INIT,
    HANDLE,
    HOST_INIT,
    INIT,
    Case,
    Json,
    breaches,
    changed,
    greeting,
    server,
    talk,
)


def sends(*packets: Json, capabilities: list[str] = ALL) -> list[Entry]:
    return talk("ipc", *greeting(*capabilities), *(server(packet) for packet in packets))


def broken(pointer: str, value: Any = ..., init: Json = HOST_INIT) -> list[Entry]:
    return sends(changed(init, pointer, value))


KEPT = sends(HOST_INIT)
BREAKS: list[tuple[str, str, Any]] = [
    ("MEM-1", "/version", "1.02"),
    ("MEM-2", "/memory/bytes", 0),
    ("MEM-3", "/mem_color", HANDLE),
    ("MEM-8", "/ring/slots", 0),
    ("MEM-9", "/memory/bytes", 184319),
    ("MEM-12", "/semantics/alpha", "opaque"),
]

CASES = [
    Case(requirement, "server", KEPT, broken(pointer, value))
    for requirement, pointer, value in BREAKS
    if requirement != "MEM-3"
]
CASES.append(Case("MEM-3", "server", KEPT, sends({**HOST_INIT, "mem_color": HANDLE})))


def test_generations_grow() -> None:
    assert breaches(sends(HOST_INIT, {**HOST_INIT, "generation": 2})) == {}
    assert breaches(sends(HOST_INIT, HOST_INIT)) == {("server", "MEM-1"): 1}


def test_a_packet_of_1_0_from_a_server_that_says_welcome_breaks_mem_1_alone() -> None:
    assert breaches(sends(INIT)) == {("server", "MEM-1"): 1}


def test_cuda_memory_without_frames_needs_no_ring() -> None:
    without = changed(CUDA_INIT, "/ring")
    assert breaches(sends(without, capabilities=["cuda_ipc"])) == {}


def test_colour_and_depth_may_take_turns() -> None:
    ring = {**HOST_INIT["ring"], "colorStride": 61440, "depthOffset": 49152, "depthStride": 61440}
    assert breaches(sends({**HOST_INIT, "ring": ring})) == {}
    closer = {**HOST_INIT, "ring": {**ring, "depthOffset": 49136}}
    assert breaches(sends(closer)) == {("server", "MEM-9"): 1}


@pytest.mark.parametrize(
    "pointer", ["/generation", "/memory/bytes", "/ring/slots", "/ring/colorStride"]
)
def test_numbers_as_strings_break_jsn_4_alone(pointer: str) -> None:
    value: Any = HOST_INIT
    for name in pointer[1:].split("/"):
        value = value[name]
    assert breaches(broken(pointer, str(value))) == {("server", "JSN-4"): 1}


@pytest.mark.parametrize("value", [100.0, 0, "inf", 3.4028235677973362e38])
def test_the_depth_of_an_empty_pixel(value: object) -> None:
    assert breaches(broken("/semantics/depth/empty", value)) == {}
