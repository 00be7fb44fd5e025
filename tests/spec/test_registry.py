"""The registry of requirements is what the prose says, and ids keep their meaning."""

import copy
import hashlib
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from splatbus_schemas import VERSIONS, prose

from tests.released import RELEASED, meanings

ID = re.compile(r"\b[A-Z]{3}-\d+\b")


FINAL = json.loads(Path(__file__).with_name("final.json").read_text("utf-8"))
"""The digest of each chapter of the versions that are final, of their requirements and schemas."""


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def released() -> dict[str, dict[str, str]]:
    """Of each version that is not final, what its ids meant."""
    loaded: dict[str, dict[str, str]] = json.loads(RELEASED.read_text("utf-8"))
    return loaded


def by_id(registry: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {each["id"]: each for each in registry["requirements"]}


def changed_ids(former: Mapping[str, str], current: Mapping[str, Any]) -> set[str]:
    """The released ids that are gone, or mean something else now."""
    now = meanings(current)
    return {name for name, meaning in former.items() if now.get(name) != meaning}


def announced_changes() -> set[str]:
    text = (prose.CHECKOUT / "spec" / "README.md").read_text("utf-8")
    (section,) = re.findall(r"^## Changes since the last release$(.*?)^## ", text, re.M | re.S)
    return set(ID.findall(section))


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
def test_what_is_final_never_changes_and_nothing_else_unannounced(version: str) -> None:
    current = prose.collect(version)
    if current["status"] == "final":
        registry = prose.registry_path(version)
        held = (*prose.chapters(version), registry, *registry.parent.glob("*.schema.json"))
        assert {it.name: digest(it) for it in held} == FINAL[version]
    else:
        assert version not in FINAL
        assert changed_ids(released()[version], current) <= announced_changes()


def test_announced_changes_are_of_ids_that_exist_or_did() -> None:
    now = (name for version in VERSIONS for name in by_id(prose.collect(version)))
    assert announced_changes() <= {*now, *(name for ids in released().values() for name in ids)}


def _drop(registry: Any) -> None:
    registry["requirements"] = [r for r in registry["requirements"] if r["id"] != "FRM-3"]


def _renumber(registry: Any) -> None:
    by_id(registry)["FRM-3"]["id"] = "FRM-99"


def _loosen(registry: Any) -> None:
    by_id(registry)["FRM-3"]["level"] = "SHOULD"


def _spare_servers(registry: Any) -> None:
    by_id(registry)["FRM-3"]["binds"] = ["client"]


def _accept_more(registry: Any) -> None:
    by_id(registry)["FRM-3"]["acceptable"].append("ignores")


def _reword(registry: Any) -> None:
    by_id(registry)["FRM-3"]["sentence"] += " Soon."


@pytest.mark.parametrize(
    "change", [_drop, _renumber, _loosen, _spare_servers, _accept_more, _reword]
)
def test_a_change_of_meaning_is_seen(change: Callable[[Any], None]) -> None:
    former = prose.collect("1.0")
    current = copy.deepcopy(former)
    change(current)
    assert changed_ids(meanings(former), current) == {"FRM-3"}


def test_a_new_reason_or_a_new_id_changes_no_meaning() -> None:
    former = prose.collect("1.0")
    current = copy.deepcopy(former)
    by_id(current)["FRM-3"] |= {"why": "because", "chapter": "spec/1.0/elsewhere.md"}
    current["requirements"].append({**by_id(current)["FRM-3"], "id": "FRM-99"})
    assert changed_ids(meanings(former), current) == set()
