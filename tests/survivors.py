"""`python -m tests.survivors`: the mutants made by machine that live, by family, as a page.

Each is put into the first family of `results/families.json` that has a pattern for it, which says
why it is not seen, or what it would take.
"""

import json
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

RESULTS = Path(__file__).parent / "results"
FORMER, NEWEST = RESULTS / "machine.former.json", RESULTS / "machine.json"
"""What led to checks, of which those that live are kept, and what was drawn afterwards with another
seed.
"""
FAMILIES = RESULTS / "families.json"
PAGE = Path(__file__).parents[1] / "conformance" / "SURVIVORS.md"
SEEN = ("killed", "not executed")
HEAD = (
    "# Mutants made by machine that live\n\n"
    "`python -m tests.zoo.machine` changes the reference's own sources (a comparison, "
    "a bound, a dropped statement), and asks the harness and the tests of each. What the harness "
    "does not see is below, by family: why, or what it would take. They were sorted by reading "
    "them, mostly a function at a time. A test holds that every one is in a family; "
    "`python -m tests.survivors` writes this page.\n\n"
)


class Family(NamedTuple):
    """Mutants that live for the same reason: all of some fates, or those that survived and whose
    names fit a pattern, as in file names, without `splatbus_`.
    """

    title: str
    why: str
    fates: tuple[str, ...]
    patterns: tuple[str, ...]

    def has(self, mutant: dict[str, Any]) -> bool:
        """Whether a mutant is one of it."""
        fits = any(fnmatchcase(mutant["name"], pattern) for pattern in self.patterns)
        return mutant["fate"] in self.fates or (mutant["fate"] == "survived" and fits)


def families() -> list[Family]:
    """In the order in which they are asked."""
    found = json.loads(FAMILIES.read_text("utf-8"))
    return [
        Family(it["title"], it["why"], tuple(it.get("fates", ())), tuple(it.get("patterns", ())))
        for it in found
    ]


def survivors() -> list[dict[str, Any]]:
    """Those that a run executes and no check broke a MUST over; of one judged twice, the newest."""
    judged = {
        it["name"]: it
        for path in (FORMER, NEWEST)
        for it in json.loads(path.read_text("utf-8"))["judged"]
    }
    return [it | {"name": short(it["name"])} for it in judged.values() if it["fate"] not in SEEN]


def short(name: str) -> str:
    """Without what all of them begin with."""
    return name.removeprefix("splatbus_")


def sorted_into(found: list[Family]) -> dict[str, list[dict[str, Any]]]:
    """The survivors of each family, by its title; those of none under the empty one."""
    those: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for it in survivors():
        those[next((each.title for each in found if each.has(it)), "")].append(it)
    return those


def page() -> str:
    """As Markdown."""
    told = [line for path in (NEWEST, FORMER) for line in figures(path)]
    found = families()
    those = sorted_into(found)
    lines = [*told[:-1], *(line for it in found for line in section(it, those))]
    return HEAD + "\n".join(lines) + "\n"


def figures(path: Path) -> list[str]:
    """What is said of one result."""
    result = json.loads(path.read_text("utf-8"))
    count = sum(map(int, re.findall(r": (\d+)", result["summary"][-1])))
    drawn = f"{count:,} drawn with seed {result['seed']}"
    since = ", before what they showed was mended" if path == FORMER else ""
    head = f"{drawn}, at `{result['commit'][:12]}`{since}:"
    return [head, "", *(f"- {line}" for line in result["summary"]), ""]


def section(family: Family, those: dict[str, list[dict[str, Any]]]) -> Iterator[str]:
    """What is said of one family."""
    mine = those[family.title]
    fates = Counter(it["fate"] for it in mine)
    tested = sum(it["tested"] == "killed" for it in mine)
    counted = ", ".join(f"{count} {fate}" for fate, count in fates.most_common())
    yield from ("", f"## {family.title}", "", family.why, "")
    yield f"{counted}; a test of ours kills {tested}."
    yield ""
    changes: dict[str, list[str]] = defaultdict(list)
    for it in sorted(mine, key=lambda it: it["name"]):
        module, function, change = it["name"].split(":", 2)
        changes[f"{module}:{function}"].append(change)
    yield from (f"- `{where}`: {', '.join(each)}" for where, each in changes.items())


if __name__ == "__main__":
    PAGE.write_text(page(), "utf-8")
