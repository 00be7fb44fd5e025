"""Inputs out of inputs: bytes changed, moved, doubled, cut, and put together with others."""

from __future__ import annotations

import re
from collections.abc import Sequence
from random import Random

HEADER = 4
MOST_BYTES = 8192
TOKENS = [
    *(b"{", b"}", b"[", b"]", b":", b",", b'"', b"\\", b"{}", b"[]", b"\xff", b"\n", b" "),
    *(b"\\u0000", b"\\ud800", b"\\udc00", b"\xef\xbb\xbf", b"\xc3", b"\xf0\x9f", b"0" * 30),
    *(b"\0\0\0\0", b"\x01\0\0\0", b"\x20\0\0\0", b"\0\0\x10\0", b"\x01\0\x10\0", b"\xff" * 4),
    *(b'"id":1,', b'"type":', b'"generation":1', b'"seq":1'),
]
VALUES = [
    *(b"null", b"true", b"false", b"0", b"-0", b"1", b"-1", b"2", b"0.5", b"1e5", b"1E400", b"1.0"),
    *(b"9007199254740991", b"9007199254740992", b"1e-320", b"NaN", b"-Infinity", b"1" * 400, b"01"),
    *(
        b'""',
        b'"a"',
        b'"\\u0000"',
        b'"\\ud800"',
        b'"\\udc00"',
        b'"\\ud83d\\ude00"',
        b'"1"',
        b"1" * 5000,
    ),
    *(
        b"[" * 70 + b"]" * 70,
        b'{"a":' * 65 + b"1" + b"}" * 65,
        b"[]",
        b"{}",
        b"[1,2,3,4]",
        b'["color"]',
    ),
    *(b'{"a":1,"a":2}', b'"' + b"a" * 70 + b'"', b'"' + "ü€😀".encode() + b'"'),
]
NUMBER = re.compile(rb"[0-9]+")
VALUE = re.compile(rb'"(?:[^"\\]|\\.)*"|-?[0-9][0-9.eE+-]*|true|false|null')


class Mutator:
    """Draws everything from one source of chance.

    Args:
        random: the source.
        words: pieces that inputs of this kind are made of.
    """

    def __init__(self, random: Random, words: Sequence[bytes]) -> None:
        self._random = random
        self._words = [*TOKENS, *words]

    def mutated(self, data: bytes, others: Sequence[bytes]) -> bytes:
        """The input changed in one way or a few."""
        draw = self._random
        for _ in range(draw.choice((1, 1, 1, 2, 3, 6))):
            data = self._changed(data, others)
        return data[:MOST_BYTES]

    def _changed(self, data: bytes, others: Sequence[bytes]) -> bytes:
        draw = self._random
        at = draw.randint(0, len(data))
        end = min(len(data), at + draw.choice((1, 1, 2, 4, 8, 32, 200)))
        way = draw.randrange(14)
        if way <= 1:  # a word put in, or in the place of what was there
            return data[:at] + draw.choice(self._words) + data[at if way else end :]
        if way == 2:
            return data[:at] + data[end:]
        if way == 3:
            return data[:at] + data[at:end] * draw.choice((2, 2, 3, 20)) + data[end:]
        if way == 4 and at < len(data):
            return data[:at] + bytes((data[at] ^ 1 << draw.randrange(8),)) + data[at + 1 :]
        if way == 5:
            return data[:at] + draw.randbytes(draw.randint(1, 4)) + data[end:]
        if way == 6:  # the rest of another
            other = draw.choice(others)
            return data[:at] + other[draw.randint(0, len(other)) :]
        if way == 7:  # a piece of another
            other = draw.choice(others)
            begins = draw.randint(0, len(other))
            return data[:at] + other[begins : begins + draw.randint(1, 60)] + data[at:]
        if way == 8:
            return self._with_another_number(data, at)
        if way == 9:
            return self._with_parts_moved(data)
        if way <= 12:
            return self._with_another_value(data, at, others)
        if data[HEADER : HEADER + 1] == b"{":  # a packet, under the right header
            return (len(data) - HEADER).to_bytes(HEADER, "little") + data[HEADER:]
        return data[:at]

    def _with_another_value(self, data: bytes, at: int, others: Sequence[bytes]) -> bytes:
        """The next name or value in the text another one, of this kind or of any."""
        value, draw = VALUE.search(data, at), self._random
        if value is None:
            return data
        new = draw.choice(VALUES)
        if draw.random() < 0.4:
            found = VALUE.findall(draw.choice(others))
            new = draw.choice(found) if found else new
        return data[: value.start()] + new + data[value.end() :]

    def _with_another_number(self, data: bytes, at: int) -> bytes:
        """The next number in the text, a little or much different."""
        found = NUMBER.search(data, at)
        if found is None:
            return data
        value = int(found[0][:18])
        draw = self._random
        value = draw.choice((value + 1, value - 1, value * 10, -value, value * 2**32, 0))
        return data[: found.start()] + str(value).encode() + data[found.end() :]

    def _with_parts_moved(self, data: bytes) -> bytes:
        """Steps, lines or members in another order, or one of them left out or doubled."""
        draw = self._random
        mark = draw.choice((b"\xff", b"\n", b",", b"}"))
        parts = data.split(mark)
        if len(parts) < 2:
            return data
        i, j = draw.randrange(len(parts)), draw.randrange(len(parts))
        way = draw.randrange(3)
        if way == 0:
            parts[i], parts[j] = parts[j], parts[i]
        elif way == 1:
            parts.insert(i, parts[j])
        else:
            del parts[i]
        return mark.join(parts)
