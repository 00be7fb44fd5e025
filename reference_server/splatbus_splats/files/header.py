"""The header of a PLY file: which elements follow, of which properties, and how numbers lie there.

Lines of a text: `ply`, `format`, then an `element` after the other, each with its `property` lines,
until `end_header`; `comment` and `obj_info` anywhere. They end in a line feed, or in a carriage
return and one.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import BinaryIO, NamedTuple

TYPES = {
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "i2": ("short", "int16"),
    "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"),
    "u4": ("uint", "uint32"),
    "f4": ("float", "float32"),
    "f8": ("double", "float64"),
}
"""What a type is called in a file, the older name first, by NumPy's letter and bytes."""
CODES = {name: code for code, names in TYPES.items() for name in names}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""Formats, and NumPy's sign for their byte order; none for a text."""
VERTICAL = re.compile(r"vertical axis: ?\+?(-?[xyz])", re.IGNORECASE)
MOST_LINE_BYTES = 1 << 16
MOST_BYTES = 1 << 20
"""Of a header: with more it is no header that anybody wrote."""


class Property(NamedTuple):
    """One number of a row, or a list of some."""

    name: str
    number: str
    """NumPy's letter and bytes, such as "f4"."""
    length: str
    """The same of the length that lies before a list; nothing where it is no list."""


class Element(NamedTuple):
    """A table of the file."""

    name: str
    rows: int
    """As many as the header claims."""
    properties: list[Property]


class Header(NamedTuple):
    """What a file says of itself."""

    order: str
    """Of the bytes of a number, "<" or ">"; nothing where numbers are text."""
    elements: list[Element]
    lines: int
    up: str = ""
    """Which axis is vertical, upwards, such as "z" or "-y", where a comment says so."""


def read_header(file: BinaryIO, path: Path) -> Header:
    """The header of a file, which is left where its data begin.

    Raises:
        ValueError: it is none; the message names the file and the line.
    """
    if file.readline(MOST_LINE_BYTES).rstrip(b"\r\n") != b"ply":
        raise ValueError(f"{path}: no PLY file: its first line is not 'ply'")
    order: str | None = None
    elements: list[Element] = []
    number, up = 1, ""
    while True:
        number += 1
        where = f"{path}: line {number}"
        line = file.readline(MOST_LINE_BYTES)
        if len(line) == MOST_LINE_BYTES or file.tell() > MOST_BYTES:
            raise ValueError(f"{where}: too long for a header: it is no PLY file, or a damaged one")
        if not line.endswith(b"\n"):
            raise ValueError(
                f"{where}: the file ends at byte {file.tell()}, in its header: it is cut short"
            )
        keyword, *words = line.decode("utf-8", "replace").split() or [""]
        if keyword == "end_header" and not words:
            break
        if keyword == "format":
            if order is not None:
                raise ValueError(f"{where}: a second format")
            order = _order(words, where)
        elif keyword == "element":
            elements.append(_element(words, where, elements))
        elif keyword == "property":
            if not elements:
                raise ValueError(f"{where}: a property before the first element")
            elements[-1].properties.append(_property(words, where, elements[-1]))
        elif keyword in ("comment", "obj_info"):
            if told := VERTICAL.fullmatch(" ".join(words)):
                up = told[1].lower()
        else:
            shown = " ".join((keyword, *words))[:40]
            raise ValueError(f"{where}: {shown!r} is no line of a header")
    if order is None:
        raise ValueError(f"{where}: the header ends without a format")
    return Header(order, elements, number, up)


def _order(words: list[str], where: str) -> str:
    if len(words) != 2 or words[0] not in ORDERS or words[1] != "1.0":
        allowed = ", ".join(ORDERS)
        raise ValueError(f"{where}: format {' '.join(words)!r}, where there are {allowed}, all 1.0")
    return ORDERS[words[0]]


def _element(words: list[str], where: str, others: list[Element]) -> Element:
    if len(words) != 2 or not re.fullmatch(r"[0-9]{1,30}", words[1]):
        raise ValueError(f"{where}: an element has a name and a count of rows")
    if words[0] in (each.name for each in others):
        raise ValueError(f"{where}: a second element {words[0]}")
    return Element(words[0], int(words[1]), [])


def _property(words: list[str], where: str, element: Element) -> Property:
    is_list = words[:1] == ["list"]
    *types, name = words[is_list:] or [""]
    if len(types) != 1 + is_list:
        raise ValueError(f"{where}: a property has a type and a name, a list two types")
    for each in types:
        if each not in CODES:
            raise ValueError(f"{where}: {each!r} is no type of a number")
    codes = [CODES[each] for each in types]
    if is_list and codes[0].startswith("f"):
        raise ValueError(f"{where}: the length of a list is a whole number, not a {types[0]}")
    if name in (each.name for each in element.properties):
        raise ValueError(f"{where}: a second property {name} of {element.name}")
    return Property(name, codes[-1], codes[0] if is_list else "")
