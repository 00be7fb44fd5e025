"""The registry of requirements is what the prose says, and what is final stays as it is."""

import json
import re
from collections.abc import Mapping
from typing import Any

import pytest
from splatbus_schemas import VERSIONS, prose

from tests.released import FINAL, digests


def by_id(registry: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {each["id"]: each for each in registry["requirements"]}


def outcomes_defined(version: str) -> set[str]:
    text = (prose.CHECKOUT / "spec" / version / "README.md").read_text("utf-8")
    head = r"\| outcome \| what it means \|\n\|---\|---\|\n"
    (rows,) = re.findall(rf"^{head}((?:\|.*\n)+)", text, re.M)
    return set(re.findall(r"^\| `(\w+)` \|", rows, re.M))


@pytest.mark.parametrize("version", VERSIONS)
def test_the_registry_is_what_the_prose_says(version: str) -> None:
    assert prose.registry_path(version).read_text("utf-8") == prose.rendered_registry(version)


def test_the_command_finds_nothing_to_write(capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main([]) == 0
    assert capsys.readouterr().out == ""


def test_an_id_stands_in_one_version_only() -> None:
    former, later = (set(by_id(prose.collect(version))) for version in VERSIONS)
    assert former & later == set()


@pytest.mark.parametrize("version", VERSIONS)
def test_outcomes_are_those_that_the_introduction_defines(version: str) -> None:
    assert outcomes_defined(version) == prose.OUTCOMES[version]


@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_final_never_changes(version: str) -> None:
    held = json.loads(FINAL.read_text("utf-8"))
    final = prose.collect(version)["status"] == "final"
    assert held.get(version) == (digests(version) if final else None)
