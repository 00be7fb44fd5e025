"""Every rule on the init packet's members of 1.0, kept and broken."""

from typing import Any

import pytest
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    HANDLE,
    INIT,
    Case,
    breaches,
    changed,
    talk,
)
from tests.conformance.rules.talk import server as says


def sends(packet: dict | bytes) -> list[Entry]:
    return talk("ipc", says(packet))


def broken(pointer: str, value: Any = ...) -> list[Entry]:
    return sends(changed(INIT, pointer, value))


BREAKS: list[tuple[str, str, Any]] = [
    ("INI-1", "/mem_color", ...),
    ("INI-2", "/meta/h", 0),
    ("INI-3", "/meta/fmtColor", "RGBA8"),
    ("INI-4", "/meta/pitchColor", 1040),
    ("INI-5", "/meta/offsetColor", 8),
    ("INI-6", "/meta/device", -1),
    ("INI-7", "/evt_done", HANDLE[:-2]),
]

CASES = [
    Case(requirement, "server", sends(INIT), broken(pointer, value))
    for requirement, pointer, value in BREAKS
]


@pytest.mark.parametrize(
    "packet",
    [
        changed(changed(INIT, "/meta/device"), "/meta/offsetColor"),
        changed(INIT, "/meta/w", 64.0),
        {**INIT, "later": {"w": 0}},
        {**INIT, "type": "init"},
    ],
)
def test_what_breaks_nothing(packet: dict) -> None:
    assert breaches(sends(packet)) == {}


@pytest.mark.parametrize("name", ["w", "pitchColor", "offsetDepth", "device"])
def test_numbers_as_strings_break_jsn_4_alone(name: str) -> None:
    as_text = broken(f"/meta/{name}", str(INIT["meta"][name]))
    assert breaches(as_text) == {("server", "JSN-4"): 1}


def test_numbers_that_are_not_finite_break_jsn_4_alone() -> None:
    for name in ("w", "pitchColor", "offsetColor", "device"):
        payload = broken(f"/meta/{name}", 4.125)[1].data
        assert payload is not None
        spoiled = payload[4:].replace(b"4.125", b"NaN")
        assert breaches(sends(spoiled)) == {("server", "JSN-4"): 1}


def test_a_packet_without_any_of_the_members_is_no_init_packet() -> None:
    assert breaches(sends({})) == {}
    assert breaches(sends({"type": "later", "memory": {}})) == {}
