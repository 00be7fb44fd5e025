"""Files that somebody gives: no more of one is read than it may have, and its JSON is JSON."""

import json
import math
from pathlib import Path
from typing import Any, NoReturn

MOST_BYTES = 1 << 26
"""Of a file that has to be read as a whole."""
MOST_SHOWN = 60


def read_text(path: Path) -> str:
    """A file as text. Raises OSError; ValueError for one that is too long, or not UTF-8."""
    with path.open("rb") as file:
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES:,} bytes")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"byte {error.start} is not UTF-8") from None


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
