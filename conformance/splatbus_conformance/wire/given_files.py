"""Files that somebody gives: no more of one is read than it may have, and its JSON is JSON."""

import json
import math
from pathlib import Path
from typing import Any, NoReturn

MOST_BYTES = 1 << 26
"""Of a file that has to be read as a whole."""
MOST_SHOWN = 60
_UTF_16 = "it is UTF-16, as Windows PowerShell writes what is redirected: save it as UTF-8"
FOREIGN = {
    **dict.fromkeys((b"\xff\xfe", b"\xfe\xff", b"{\0", b"\0{"), _UTF_16),
    b"\x1f\x8b": "it is compressed with gzip: unpack it first",
    b"\x28\xb5\x2f\xfd": "it is compressed with zstd: unpack it first",
    b"\xfd7zXZ": "it is compressed with xz: unpack it first",
    b"PK\3\4": "it is a zip archive: unpack it first",
}
"""What a file is that begins so."""


def read_text(path: Path) -> str:
    """A file as text. Raises OSError; ValueError for one that is too long, or not UTF-8."""
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES:,} bytes")
    return decoded(data)


def decoded(data: bytes, place: int = 0) -> str:
    """The text of a file, or of a line that begins at this place in it; a byte-order mark in front
    is no part of it. Raises ValueError.
    """
    if not place:
        for begin, what in FOREIGN.items():
            if data.startswith(begin):
                raise ValueError(what)
    try:
        return data.decode("utf-8" if place else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"byte {place + error.start} is not UTF-8") from None


def from_json(text: str) -> Any:
    """The value of a JSON text, of which every number fits double precision. Raises ValueError."""
    try:
        return json.loads(text, parse_constant=_refused, parse_float=_number, parse_int=_integer)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def shown(value: object) -> str:
    """A value that is not as it should be, so short that a line holds it."""
    text = repr(value)
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]} …"


def _number(spelling: str) -> float:
    value = float(spelling)
    return value if math.isfinite(value) else _refused(spelling)


def _integer(spelling: str) -> int:
    _number(spelling)
    return int(spelling)


def _refused(spelling: str) -> NoReturn:
    raise ValueError(f"{shown(spelling)} is no number that double precision holds")
