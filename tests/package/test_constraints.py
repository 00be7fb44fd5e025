"""`constraints.txt` pins every package of the development environment, in pyproject's ranges.

What fails here is mended by the command at the head of that file.
"""

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import NormalizedName, canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
EXTRAS = PYPROJECT["project"]["optional-dependencies"]
BUILD = PYPROJECT["build-system"]["requires"]


def constraints() -> list[Requirement]:
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    return [Requirement(line) for line in lines if not line.startswith("#")]


def pinned() -> dict[NormalizedName, Version]:
    """What is installed here under these constraints."""
    return {
        canonicalize_name(each.name): Version(str(each.specifier).removeprefix("=="))
        for each in constraints()
        if each.marker is None or each.marker.evaluate()
    }


def asked_for(*extras: str) -> list[Requirement]:
    """What pyproject.toml asks for, in these extras, or without any."""
    groups = [PYPROJECT["project"]["dependencies"], *(EXTRAS[extra] for extra in extras)]
    asked = [Requirement(each) for group in groups for each in group]
    return [each for each in asked if each.name != PYPROJECT["project"]["name"]]


def in_turn(asked: list[Requirement]) -> list[Requirement]:
    """All that, and what the packages installed here need for it."""
    found: dict[str, Requirement] = {}
    waiting = list(asked)
    while waiting:
        wanted = waiting.pop()
        if str(wanted) in found:
            continue
        found[str(wanted)] = wanted
        for line in requires(wanted.name) or ():
            needed = Requirement(line)
            if needed.marker is None or any(
                needed.marker.evaluate({"extra": extra}) for extra in ("", *wanted.extras)
            ):
                waiting.append(needed)
    return list(found.values())


def test_every_line_pins_one_version_exactly() -> None:
    loose = [str(c) for c in constraints() if not re.fullmatch(r"==[\w.!+]+", str(c.specifier))]
    assert constraints()
    assert loose == []


@pytest.mark.parametrize(
    "wanted", [*asked_for(*EXTRAS), *(Requirement(each) for each in BUILD)], ids=str
)
def test_what_pyproject_asks_for_is_pinned_in_its_range(wanted: Requirement) -> None:
    assert pinned()[canonicalize_name(wanted.name)] in wanted.specifier


def test_what_that_needs_in_turn_is_pinned_too_in_its_range() -> None:
    pins = pinned()
    wanted = in_turn(asked_for("dev", "fast", "site", "splats"))
    missing = {each.name for each in wanted if canonicalize_name(each.name) not in pins}
    assert missing == set()
    outside = [str(w) for w in wanted if pins[canonicalize_name(w.name)] not in w.specifier]
    assert outside == []
    assert len(wanted) > len(asked_for("dev", "fast", "site", "splats"))


def test_the_tool_that_builds_is_the_one_that_development_has() -> None:
    assert set(BUILD) <= set(EXTRAS["dev"])


def test_the_readme_tests_with_these() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    (command,) = re.findall(r"^.*-m tests$", readme, re.MULTILINE)
    installs = "pip install --quiet --no-compile --constraint constraints.txt --editable '.[dev]'"
    assert installs in command
