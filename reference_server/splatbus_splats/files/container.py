"""Rows of a PLY file, read in pieces: beside the numbers that are wanted only one piece is held.

Sizes that a file claims are compared with its own before anything is allocated for them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from io import BufferedReader
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.files.header import TYPES, Element, Header

Rows = NDArray[Any]


class Place(NamedTuple):
    """Where the rows of an element begin."""

    byte: int
    line: int
    """In a text."""


def found(file: BufferedReader, path: Path, header: Header, wanted: Element) -> Place:
    """Where the rows of an element of numbers begin: behind those of the elements before it.

    Args:
        file: just behind its header.
        path: for messages.
        header: of the file.
        wanted: one of its elements.

    Raises:
        ValueError: the file is too short for what its header claims, or the rows lie behind
            binary lists; the message says where.
    """
    size, line = os.fstat(file.fileno()).st_size, header.lines
    for element in header.elements:
        begin = file.tell()
        least = element.rows * _least_bytes(header.order, element) - (not header.order)
        if begin + least > size:
            raise _cut_short(path, element, size)
        if element is wanted:
            return Place(begin, line)
        if header.order and any(each.length for each in element.properties):
            raise ValueError(f"{path}: lists of {element.name} lie before the {wanted.name} rows")
        if header.order:
            file.seek(begin + least)
        else:
            _skip_lines(file, path, element, size)
        line += element.rows
    raise ValueError(f"{path}: it has no element {wanted.name}")


def pieces(
    file: BufferedReader, path: Path, header: Header, element: Element, place: Place, step: int
) -> Iterator[Rows]:
    """The rows of an element of numbers, so many at a time; each piece is valid until the next.

    Args:
        file: that is read.
        path: for messages.
        header: of the file.
        element: one without lists.
        place: of its rows.
        step: rows at a time.

    Raises:
        ValueError: the file ends before its last row, or a text is no number of its type; the
            message says where.
    """
    dtype = np.dtype([(each.name, header.order + each.number) for each in element.properties])
    file.seek(place.byte)
    if header.order:
        yield from blocks(file, path, dtype, element.rows, step)
        return
    for start in range(0, element.rows, step):
        count = min(step, element.rows - start)
        lines = [line.decode("utf-8", "replace") for line in islice(file, count)]
        if len(lines) < count:
            raise _cut_short(path, element, os.fstat(file.fileno()).st_size)
        yield _from_text(lines, dtype, f"{path}: line", place.line + start + 1)


def blocks(
    file: BufferedReader, path: Path, dtype: np.dtype[Any], count: int, step: int
) -> Iterator[Rows]:
    """Binary rows from where a file stands, so many at a time, all in the same memory."""
    room = np.empty(min(step, count), dtype)
    for start in range(0, count, step):
        part = room[: count - start]
        if file.readinto(part.view(np.uint8).data) < part.nbytes:
            size = os.fstat(file.fileno()).st_size
            raise ValueError(f"{path}: the file ends at byte {size}, earlier than when it was met")
        yield part


def write(path: Path, rows: Rows, *comments: str) -> None:
    """Writes vertices of numbers in float32 or float64, little-endian."""
    names = rows.dtype.names or ()
    lines = ["ply", "format binary_little_endian 1.0", *(f"comment {each}" for each in comments)]
    lines += [f"element vertex {len(rows)}"]
    types = {name: "f8" if rows.dtype[name] == np.float64 else "f4" for name in names}
    lines += [f"property {TYPES[types[name]][0]} {name}" for name in names]
    with path.open("wb") as file:
        file.write("".join(f"{line}\n" for line in (*lines, "end_header")).encode("ascii"))
        rows.astype([(name, f"<{types[name]}") for name in names], copy=False).tofile(file)


def _least_bytes(order: str, element: Element) -> int:
    """Of a row with empty lists; of a text, a digit and what parts it from the next."""
    if not order:
        return 2 * len(element.properties)
    return sum(int((each.length or each.number)[1]) for each in element.properties)


def _cut_short(path: Path, element: Element, size: int) -> ValueError:
    return ValueError(
        f"{path}: the file ends at byte {size}, before the last of {element.rows:,} rows of"
        f" {element.name}: it is cut short, as by a download that broke off"
    )


def _skip_lines(file: BufferedReader, path: Path, element: Element, size: int) -> None:
    for _ in range(element.rows if element.properties else 0):
        if not file.readline():
            raise _cut_short(path, element, size)


def _from_text(lines: list[str], dtype: np.dtype[Any], where: str, first: int) -> Rows:
    """Rows of text; `first` is the number of their first line."""
    try:
        if all(map(str.strip, lines)):  # empty ones would be passed over
            return np.loadtxt(lines, dtype, comments=None, ndmin=1)
    except ValueError:
        pass
    if len(lines) == 1:
        raise ValueError(
            f"{where} {first}: {lines[0].strip()[:40]!r} is no row of the"
            f" {len(dtype.names or ())} numbers that the header says, of their types"
        )
    half = len(lines) // 2
    parts = (lines[:half], first), (lines[half:], first + half)
    return np.concatenate([_from_text(each, dtype, where, number) for each, number in parts])
