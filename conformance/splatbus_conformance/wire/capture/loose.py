"""Packets told again in the middle of a stream."""

import re
from bisect import bisect_right
from itertools import accumulate

from splatbus_schemas import LIMITS

from splatbus_conformance.wire.capture.streams import Piece, Run
from splatbus_conformance.wire.packets import HEADER

_HEADER_AND_OBJECT = re.compile(rb"..[\x00-\x10]\x00[ \t\r\n]*\{", re.DOTALL)
"""No text of JSON has a byte of 0, so that this is no part of one."""


def whole_packets(run: Run) -> tuple[list[Piece], int]:
    """The packets that can be told in a run that may begin and end within one, and how many other
    bytes it has.
    """
    data = b"".join(piece.data or b"" for piece in run)
    ends = list(accumulate(len(piece.data or b"") for piece in run))
    found: list[Piece] = []
    at = others = 0
    while match := _HEADER_AND_OBJECT.search(data, at):
        begin = match.start()
        length = int.from_bytes(data[begin : begin + HEADER], "little")
        end = begin + HEADER + length
        if not 1 <= length <= LIMITS["max_payload_bytes"] or end > len(data):
            end = begin + 1
            others += end - at
        else:
            others += begin - at
            arrived = run[bisect_right(ends, end - 1)]
            found.append(arrived._replace(data=data[begin:end]))
        at = end
    return found, others + len(data) - at
