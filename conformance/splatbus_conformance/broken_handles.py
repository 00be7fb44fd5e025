"""Handles in init packets that break INI-7, and one that no driver knows."""

import base64
from collections.abc import Iterator, Mapping

from splatbus_conformance.broken_packets import NO_STRINGS, Breach
from splatbus_conformance.messages import EXAMPLE_HANDLE

UNKNOWN_HANDLE = EXAMPLE_HANDLE.decode()


def breaches_of_handles(handles: Mapping[str, str]) -> Iterator[Breach]:
    """Each handle spoilt: missing, of another type, length or spelling.

    A decoder that is not strict finds the handle of memory that is there.
    """
    for member, text in handles.items():
        raw = base64.b64decode(text)
        spoilt = (
            *NO_STRINGS,
            "",
            text.rstrip("="),
            f"{text}\n",
            f" {text}",
            f"{text[:44]}\r\n{text[44:]}",
            f"{text[:10]}!{text[10:]}",
            f"data:;base64,{text}",
            raw.hex(),
            *(base64.b64encode(other).decode() for other in (raw[:-1], raw + b"\0", raw[:32])),
        )
        for value in spoilt:
            yield Breach("INI-1" if value is NO_STRINGS[0] else "INI-7", {member: value})
