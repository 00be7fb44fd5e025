"""`constraints.txt` pins every package of the development environment, in pyproject's ranges.

What fails here is mended by the command at the head of that file.
"""

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
EXTRAS = PYPROJECT["project"]["optional-dependencies"]
BUILD = PYPROJECT["build-system"]["requires"]
LINES = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
PINS = [Requirement(line) for line in LINES if not line.startswith("#")]


def applies(wanted: Requirement, *extras: str) -> bool:
    marker = wanted.marker
    return not marker or any(marker.evaluate({"extra": extra}) for extra in ("", *extras))


def in_turn() -> dict[str, Requirement]:
    """What the development environment asks for, and what packages installed here need for it."""
    found: dict[str, Requirement] = {}
    groups = ("dev", "fast", "site", "splats", "conformance", "window")
    waiting = [Requirement(it) for group in groups for it in EXTRAS[group]]
    waiting += map(Requirement, PYPROJECT["project"]["dependencies"])
    while waiting:
        wanted = waiting.pop()
        if str(wanted) in found or wanted.name == PYPROJECT["project"]["name"]:
            continue
        found[str(wanted)] = wanted
        needed = map(Requirement, requires(wanted.name) or ())
        waiting += [each for each in needed if applies(each, *wanted.extras)]
    return found


def test_every_line_pins_one_version_exactly() -> None:
    assert [str(it) for it in PINS if not re.fullmatch(r"==[\w.!+]+", str(it.specifier))] == []


def test_what_is_asked_for_and_what_that_needs_in_turn_is_pinned_in_its_range() -> None:
    pinned = {canonicalize_name(it.name): str(it.specifier)[2:] for it in PINS if applies(it)}
    asked = {it for group in EXTRAS.values() for it in map(Requirement, group)}
    wanted = [*in_turn().values(), *(it for it in asked if it.name != PYPROJECT["project"]["name"])]
    assert {it.name for it in wanted if canonicalize_name(it.name) not in pinned} == set()
    outside = [it for it in wanted if pinned[canonicalize_name(it.name)] not in it.specifier]
    assert outside == []


def test_what_builds_is_what_development_has_and_the_readme_tests_with_these() -> None:
    assert set(BUILD) <= set(EXTRAS["dev"])
    (command,) = re.findall(r"^.*-m tests$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    installs = "pip install --quiet --no-compile --constraint constraints.txt --editable '.[dev]'"
    assert installs in command
