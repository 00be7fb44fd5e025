"""Scripts: the cases that a check delivered, as data that shows a failure without Hypothesis.

A case is one of a list that the check keeps, and then a number says which, or it was drawn, and
then the script holds it whole.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_schemas import LIMITS
from splatbus_schemas.requirements import requirements

from splatbus_conformance.plan import SIDES, Side, Usage
from splatbus_conformance.wire.given_files import read_text, shown

FORMAT = "1"


class Case(NamedTuple):
    """One case of a check."""

    drawn: bool
    value: Any
    """What was drawn; of a case that was not, its place in the list."""


Rows = tuple[tuple[Case, ...], ...]
"""For each time that a check went through cases: those to deliver, in order."""


@dataclass(frozen=True)
class Script:
    """What to deliver to a testee, and which sentence it breaks."""

    side: Side
    requirement: str
    check: str
    """The check that delivers the cases."""
    by_rule: bool
    """A passive rule finds the breach in what crossed the wire, not the check itself."""
    cases: Rows
    profile: str = "quick"
    viewport: tuple[int, int] = (64, 48)
    seed: int = 0
    """Of what the check draws besides its cases."""
    seen: str = ""
    """What the testee did."""
    tried: int = 0
    """How often it was delivered again, each time to a new testee."""
    again: int = 0
    """How often of those the testee failed."""
    transcript: tuple[str, ...] = field(default=())


class ScriptError(Usage):
    """A file is no script; the message says what is wrong with it."""


def save(script: Script, path: Path) -> None:
    """Write a script, for people and for `load`."""
    path.write_text(as_text(script) + "\n", "utf-8")


def load(path: Path) -> Script:
    """Read a script. Raises ScriptError for what is none, OSError for the file."""
    try:
        return from_text(read_text(path))
    except (ScriptError, ValueError) as error:
        raise ScriptError(f"{path}: {error}") from None


def as_text(script: Script) -> str:
    """A script as JSON."""
    members = asdict(script)
    members["cases"] = [[_case_as_json(Case(*case)) for case in row] for row in script.cases]
    return json.dumps({"format": FORMAT, **members}, indent=1)


def from_text(text: str) -> Script:
    """The reverse of `as_text`. Raises ScriptError."""
    try:
        members = json.loads(text)  # a case may hold what no JSON of the wire does
        if members.pop("format") != FORMAT:
            raise ScriptError(f"it is of another format than {FORMAT}")
        members["cases"] = tuple(
            tuple(_case_from_json(case) for case in row) for row in members["cases"]
        )
        members["viewport"] = tuple(members["viewport"])
        members["transcript"] = tuple(members["transcript"])
        return _sound(Script(**members))
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        if isinstance(error, ScriptError):
            raise
        told = shown(f"{type(error).__name__}: {error}")
        raise ScriptError(f"it is no script: {told}") from None


def _sound(script: Script) -> Script:
    """The script, whose members are what they should be. Raises ScriptError."""
    texts = (script.requirement, script.check, script.profile, script.seen, *script.transcript)
    counts = (script.seed, script.tried, script.again, *script.viewport)
    wrong: list[object] = [it for it in texts if not isinstance(it, str)]
    wrong += [it for it in counts if not isinstance(it, int) or isinstance(it, bool)]
    wrong += [] if isinstance(script.by_rule, bool) else [script.by_rule]
    wrong += [] if script.side in SIDES else [script.side]
    if not wrong:
        fits = all(0 <= it <= LIMITS["max_image_size"] for it in script.viewport)
        wrong += [] if fits and len(script.viewport) == len("wh") else [script.viewport]
        wrong += [] if script.requirement in requirements("1.1") else [script.requirement]
    if wrong:
        raise ScriptError(f"it is no script: {shown(wrong[0])} is not what stands there")
    return script


def _case_as_json(case: Case) -> dict[str, Any]:
    return {"drawn": _as_json(case.value)} if case.drawn else {"listed": case.value}


def _case_from_json(case: dict[str, Any]) -> Case:
    if "listed" in case:
        place = case["listed"]
        if type(place) is not int:
            raise TypeError(f"{shown(place)} is no place in a list")
        return Case(False, place)
    return Case(True, _from_json(case["drawn"]))


def _as_json(value: Any) -> Any:
    """JSON for a value; what JSON has no form for is an object whose one member names its type."""
    if isinstance(value, bytes):
        return {"$bytes": value.hex()}
    if isinstance(value, tuple):
        return {"$tuple": [_as_json(each) for each in value]}
    if isinstance(value, list):
        return [_as_json(each) for each in value]
    if isinstance(value, dict):
        return {"$object": [[name, _as_json(each)] for name, each in value.items()]}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a drawn case holds {value!r}, which a script has no form for")


def _from_json(value: Any) -> Any:
    if isinstance(value, list):
        return [_from_json(each) for each in value]
    if not isinstance(value, dict):
        return value
    ((kind, content),) = value.items()
    if kind == "$bytes":
        return bytes.fromhex(content)
    if kind == "$tuple":
        return tuple(_from_json(each) for each in content)
    return {name: _from_json(each) for name, each in content}


def flat(cases: Rows) -> list[tuple[int, Case]]:
    """Every case, with which going-through it belongs to."""
    return [(row, case) for row, found in enumerate(cases) for case in found]


def rows(pairs: Sequence[tuple[int, Case]], count: int) -> Rows:
    """The reverse of `flat`, for so many rows."""
    return tuple(tuple(case for number, case in pairs if number == row) for row in range(count))
