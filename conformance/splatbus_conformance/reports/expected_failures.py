"""Expected failures: a list that a person keeps, of what is known to be broken and why.

The list is TOML: it can be written by hand, has comments, and Python reads it without more.

    [[expected]]
    id = "FRM-3"
    check = "check_bad_length_closes"
    reason = "the viewer drops only lengths of 0; our issue 17"
    code = "hangs"

`check` is `rule` where the passive rules find the breach, and `code` is that of the failure, so
that one of another kind is not taken for the known one.
"""

import json
import tomllib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from splatbus_conformance.selection import Item
from splatbus_conformance.verdicts import BROKEN, Result, Verdict
from splatbus_conformance.wire.given_files import read_text
from splatbus_conformance.wire.json_reading import shorten

MEMBERS = ("id", "check", "reason", "code")
TO_LOOK_INTO = "not looked into yet"
MOST_SEEN = 200
EXPECTED = " (expected: "


@dataclass(frozen=True)
class Expectation:
    """One failure that is known."""

    id: str
    check: str
    reason: str
    code: str
    """Of the failure."""

    def __str__(self) -> str:
        return f"{self.id} {self.check}"

    def concerns(self, result: Result) -> bool:
        """The result is of the check that is listed."""
        return (self.id, self.check) == (result.requirement, result.check)


class ExpectationsError(ValueError):
    """A list of expected failures is none; the message says what is wrong with it."""


def load(path: Path, items: Collection[Item]) -> tuple[Expectation, ...]:
    """Read a list. Raises ExpectationsError, also for what names no check; OSError for the file."""
    try:
        given = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise ExpectationsError(f"{path} is not TOML: {error}") from None
    entries = given.get("expected", [])
    if set(given) - {"expected"} or not isinstance(entries, list):
        raise ExpectationsError(f"{path}: it may hold [[expected]] tables and nothing else")
    known = {(item.requirement, item.name) for item in items}
    found = [_entry(path, number, each, known) for number, each in enumerate(entries, 1)]
    if twice := sorted({str(it) for it in found if sum(str(o) == str(it) for o in found) > 1}):
        raise ExpectationsError(f"{path}: {', '.join(twice)} is listed more than once")
    return tuple(found)


def _entry(path: Path, number: int, entry: object, known: set[tuple[str, str]]) -> Expectation:
    where = f"{path}, [[expected]] number {number}"
    if not isinstance(entry, dict) or set(entry) != set(MEMBERS):
        raise ExpectationsError(f"{where}: it needs {', '.join(MEMBERS)}, and nothing else")
    for name in MEMBERS:
        if not (isinstance(entry[name], str) and entry[name].strip()):
            raise ExpectationsError(f"{where}: {name} has to be a text that is not empty")
    found = Expectation(**entry)
    if (found.id, found.check) not in known:
        others = sorted(check for id, check in known if id == found.id)
        judged = f"{found.id} is judged by {', '.join(others)}" if others else "no such id"
        raise ExpectationsError(f"{where}: no check is called {found}; {judged}")
    return found


def applied(
    results: Iterable[Result], expectations: Iterable[Expectation]
) -> tuple[list[Result], list[str]]:
    """The results with expected failures marked as such, and a sentence for each stale entry.

    What was skipped, or not selected, is no evidence against its entry.
    """
    marked, stale = list(results), []
    for expectation in expectations:
        for place, result in enumerate(marked):
            if not expectation.concerns(result):
                continue
            if result.verdict is Verdict.PASS:
                stale.append(
                    f"{expectation} passes, though it is expected to fail "
                    f"({expectation.reason}): remove its entry"
                )
            elif result.verdict in BROKEN and expectation.code == result.code:
                text = f"{result.text}{EXPECTED}{expectation.reason})"
                marked[place] = replace(result, verdict=Verdict.EXPECTED, text=text, script="")
            elif result.verdict in BROKEN:
                stale.append(
                    f"{expectation} fails in another way than expected: its code is {result.code}, "
                    f"not {expectation.code}: look at it again, then correct its entry"
                )
    return marked, stale


def listed(results: Iterable[Result], former: Sequence[Expectation], *, strict: bool) -> str:
    """The list that makes these results expected; reasons come from the former list.

    Warnings are listed only where they fail the run.
    """
    verdicts = {Verdict.FAIL, Verdict.EXPECTED} | ({Verdict.WARN} if strict else set())
    lines = [
        "# What is known to be broken, and why. Written by splatbus-conformance; give reasons."
    ]
    for result in results:
        if result.verdict in verdicts:
            known = next((it for it in former if it.concerns(result)), None)
            reason = known.reason if known else TO_LOOK_INTO
            entry = Expectation(result.requirement, result.check, reason, result.code)
            lines.append(_table(entry, result.text.partition(EXPECTED)[0]))
    return "\n".join(lines)


def _table(expectation: Expectation, seen: str) -> str:
    members = (f"{name} = {_quoted(getattr(expectation, name))}\n" for name in MEMBERS)
    return f"\n[[expected]]  # {_quoted(shorten(seen, MOST_SEEN))}\n" + "".join(members)


def _quoted(text: str) -> str:
    """A basic string of TOML: one of JSON, but for DEL and for what lies beyond 16 bits."""
    whole = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")
