"""The requirements of the specification, as collected from its prose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from splatbus_schemas.data import VERSIONS, known_to, read_json


@dataclass(frozen=True)
class Requirement:
    """One normative sentence (spec/1.0 section 1.2).

    `level` is MUST, MUST NOT, SHOULD, SHOULD NOT or MAY; `binds` names client, server or both; each
    outcome in `acceptable` satisfies the sentence; `chapter` is its file, from the checkout's root.
    """

    id: str
    level: str
    binds: tuple[str, ...]
    acceptable: tuple[str, ...]
    sentence: str
    why: str | None
    chapter: str


@cache
def requirements(version: str) -> Mapping[str, Requirement]:
    """Every requirement that applies in `version`, by id, in the order of the chapters.

    Those of 1.1 include all of 1.0. ValueError for a version that is not in `VERSIONS`.
    """
    if version not in VERSIONS:
        raise ValueError(f"there is no version {version!r}; there are {', '.join(VERSIONS)}")
    applicable = known_to(version)
    return MappingProxyType(
        {
            entry["id"]: Requirement(
                id=entry["id"],
                level=entry["level"],
                binds=tuple(entry["binds"]),
                acceptable=tuple(entry["acceptable"]),
                sentence=entry["sentence"],
                why=entry.get("why"),
                chapter=entry["chapter"],
            )
            for each in applicable
            for entry in read_json(each, "requirements.json")["requirements"]
        }
    )
