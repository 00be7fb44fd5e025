"""Options of the commands: whatever a person types wrong is told with what is right."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from typing import TypeVar

from splatbus_schemas import LIMITS

T = TypeVar("T")
Number = TypeVar("Number", int, float)
LARGEST: int = LIMITS["max_image_size"]
FARTHEST = 1.7e308
"""Whatever is finite, in round numbers."""


def option(parse: Callable[[str], T], right: str, number: str = "a") -> Callable[[str], T]:
    """The `type` of an option: where `parse` raises ValueError, the person is told what to give.

    Args:
        parse: makes of a text what is wanted.
        right: ends the sentence, such as "port from 0 to 65535, such as 6001".
        number: stands before it: "a", or "six" where `right` begins with "numbers".
    """

    def read(text: str) -> T:
        try:
            return parse(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r}: give {number} {right}") from None

    return read


def within(
    kind: Callable[[str], Number], least: float, most: float = FARTHEST
) -> Callable[[str], Number]:
    """Reads a number of this kind between these; ValueError if it is none."""

    def read(text: str) -> Number:
        found = kind(text)
        if not least <= found <= most:
            raise ValueError
        return found

    return read


def joined(words: Sequence[str], *names: str) -> list[str]:
    """Join `--pose -1,0,0` to `--pose=-1,0,0`: what follows an option of these names is none."""
    found: list[str] = []
    for word in words:
        found.append(f"{found.pop()}={word}" if found and found[-1] in names else word)
    return found


def _size(text: str) -> tuple[int, int]:
    width, height = map(_pixels, text.lower().replace("×", "x").split("x"))
    return width, height


_pixels = within(int, 1, LARGEST)
SIZE = option(_size, f"size such as 640x480, of 1 to {LARGEST} pixels either way")
POSITIVE = option(within(float, math.ulp(0.0)), "number above 0, such as 2.5")
WHOLE = option(int, "whole number, such as 2")
COUNT = option(within(int, 1), "whole number from 1 on, such as 4")
PORT = option(within(int, 0, 65535), "port from 0 to 65535, such as 6001")
