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
    first_breach,
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
    ("MEM-1", "/version", ...),
    ("MEM-1", "/version", 1.1),
    ("MEM-1", "/generation", ...),
    ("MEM-1", "/generation", 0),
    ("MEM-1", "/generation", 1.5),
    ("MEM-1", "/generation", 2**53),
    ("MEM-2", "/memory", ...),
    ("MEM-2", "/memory", "shared"),
    ("MEM-2", "/memory/kind", "vulkan"),
    ("MEM-2", "/memory/name", ...),
    ("MEM-2", "/memory/name", "../etc"),
    ("MEM-2", "/memory/name", ".hidden"),
    ("MEM-2", "/memory/name", "n" * 31),
    ("MEM-2", "/memory/name", "new\n"),
    ("MEM-3", "/evt_done", None),
    ("MEM-8", "/ring", ...),
    ("MEM-8", "/ring", [3]),
    ("MEM-8", "/ring/slots", 1025),
    ("MEM-8", "/ring/colorOffset", -16),
    ("MEM-8", "/ring/depthOffset", 147457),
    ("MEM-8", "/ring/colorStride", 49136),
    ("MEM-8", "/ring/depthStride", None),
    ("MEM-9", "/ring/depthOffset", 0),
    ("MEM-12", "/semantics", ...),
    ("MEM-12", "/semantics/rows", "top_down"),
    ("MEM-12", "/semantics/depth", "planar_z"),
    ("MEM-12", "/semantics/depth/kind", ...),
    ("MEM-12", "/semantics/depth/estimator", "mean"),
    ("MEM-12", "/semantics/depth/empty", "Infinity"),
    ("MEM-12", "/semantics/depth/empty", 2.0**128 - 2.0**103),
    ("MEM-12", "/semantics/depth/empty", -1e300),
    ("MEM-12", "/semantics/unitMetres", ...),
    ("MEM-12", "/semantics/unitMetres", 0),
    ("MEM-12", "/semantics/origin", [0.0, 0.0]),
    ("MEM-12", "/semantics/colorSpace", ["srgb"]),
]

CASES = [
    Case(requirement, "server", KEPT, broken(pointer, value))
    for requirement, pointer, value in BREAKS[:6]
    if requirement != "MEM-3"
]
CASES.append(Case("MEM-3", "server", KEPT, sends({**HOST_INIT, "mem_color": HANDLE})))


@pytest.mark.parametrize(("requirement", "pointer", "value"), BREAKS)
def test_every_member(requirement: str, pointer: str, value: object) -> None:
    assert breaches(broken(pointer, value)) == {("server", requirement): 1}
    place = {"/ring/depthOffset": "/ring"}.get(pointer) if requirement == "MEM-9" else None
    assert first_breach(broken(pointer, value)).pointer == (place or pointer)


@pytest.mark.parametrize(
    ("requirement", "pointer", "value"),
    [
        ("MEM-2", "/memory/deviceUuid", ...),
        ("MEM-2", "/memory/deviceUuid", "01234567-89ab-cdef-0123-456789abcdef"),
        ("MEM-2", "/memory/handle", ...),
        ("MEM-2", "/memory/handle", HANDLE[:-1]),
        ("MEM-8", "/ring", ...),
        ("MEM-8", "/ring/events", ...),
        ("MEM-8", "/ring/events", [HANDLE] * 2),
        ("INI-7", "/ring/events/1", "none"),
        ("INI-1", "/mem_depth", ...),
    ],
)
def test_cuda_memory(requirement: str, pointer: str, value: object) -> None:
    assert breaches(broken(pointer, value, CUDA_INIT)) == {("server", requirement): 1}


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
