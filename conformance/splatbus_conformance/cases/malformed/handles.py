"""Handles in init packets that break INI-7, and one that no driver knows."""

import base64
from collections.abc import Iterator, Mapping
from typing import Any

from splatbus_conformance.cases.malformed.init_packets import ABSENT, NO_STRINGS, BrokenInitPacket
from splatbus_conformance.wire.messages import EXAMPLE_HANDLE

UNKNOWN_HANDLE = EXAMPLE_HANDLE.decode()


def breaches_of_handles(handles: Mapping[str, str]) -> Iterator[BrokenInitPacket]:
    """Each handle spoilt: missing, of another type, length or spelling.

    A decoder that is not strict finds the handle of memory that is there.
    """
    for member, text in handles.items():
        raw = base64.b64decode(text)
        others = (raw[:-1], raw + b"\0", raw[:32])
        spoilt: dict[str, tuple[Any, ...]] = {
            "no string": NO_STRINGS[1:],
            "length": ("", raw.hex(), *(base64.b64encode(it).decode() for it in others)),
            "padding": (text.rstrip("="),),
            "white space": (f"{text}\n", f" {text}", f"{text[:44]}\r\n{text[44:]}"),
            "alphabet": (f"{text[:10]}!{text[10:]}", f"data:;base64,{text}"),
        }
        yield BrokenInitPacket("INI-1", {member: ABSENT})
        for how, values in spoilt.items():
            for value in values:
                yield BrokenInitPacket("INI-7", {member: value}, how=how)
