"""Read the requirements and the byte-level examples out of the specification's prose.

The prose is the only source of requirements (spec/README.md, "Ids"). This module turns it into the
`requirements.json` that programs read, fills in the hexadecimal form of each JSON example, and
keeps the document that holds all of 1.1, as well as what is made of the schemas for generators.

Run `python -m splatbus_schemas.prose` in a checkout to compare, with `--write` to write.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_schemas import complete
from splatbus_schemas.model.bundle import bundle
from splatbus_schemas.model.metamodel import metamodel

CHECKOUT = Path(__file__).resolve().parents[2]
LEVELS = ("MUST NOT", "MUST", "SHOULD NOT", "SHOULD", "MAY")
PEERS = ("client", "server")
CONFORMS = "conforms"
"""What is acceptable where a requirement names nothing else."""
OUTCOMES = {
    "1.0": frozenset("conforms accepts closes ignores keeps reconnects waits exits absent".split()),
    "1.1": frozenset("declines reports".split()),
}

_REQUIREMENT = re.compile(
    r"^\*\*\[(?P<id>[A-Z]{3}-\d+)\]\*\* (?P<sentence>.+)\n\n"
    r"> Binds: (?P<binds>[a-z, ]+)\.(?: Acceptable: (?P<acceptable>[a-z, ]+)\.)?\n"
    r"(?:> Why: (?P<why>.+)\n)?",
    re.MULTILINE,
)
_ANY_ID = re.compile(r"^\*\*\[([^\]]+)\]\*\*", re.MULTILINE)
_KEYWORD = re.compile(r"\b(?:MUST NOT|MUST|SHOULD NOT|SHOULD|MAY)\b")
_EXAMPLE = re.compile(
    r"```json example=(?P<name>\w+)\n(?P<json>[^\n]+)\n```\n\n"
    r"```hex example=(?P=name)\n(?P<hex>[^`]*)\n```"
)


class ProseError(ValueError):
    """The prose breaks its own form; the message names the file and what is wrong."""


class Example(NamedTuple):
    """A payload as the prose shows it, and the packet that the prose says it makes."""

    name: str
    payload: bytes
    packet: bytes
    source: str


def packet_hex(payload: bytes) -> str:
    """The packet of `payload` (FRM-1) as pairs of hexadecimal digits, 32 bytes a line."""
    packet = len(payload).to_bytes(4, "little") + payload
    return "\n".join(packet[i : i + 32].hex(" ") for i in range(0, len(packet), 32))


def requirements_in(text: str, source: str) -> Iterator[dict[str, Any]]:
    """Yield each requirement of one chapter as the object that `requirements.json` holds.

    Raises ProseError where a paragraph with an id lacks its Binds line, or does not hold exactly
    one key word.
    """
    found = 0
    for match in _REQUIREMENT.finditer(text):
        found += 1
        keywords = set(_KEYWORD.findall(match["sentence"]))
        if len(keywords) != 1:
            raise ProseError(f"{source}: {match['id']} has the key words {sorted(keywords)}")
        binds = match["binds"].split(", ")
        if not set(binds) <= set(PEERS):
            raise ProseError(f"{source}: {match['id']} binds {binds}")
        yield {
            "id": match["id"],
            "level": keywords.pop(),
            "binds": binds,
            "acceptable": (match["acceptable"] or CONFORMS).split(", "),
            "sentence": match["sentence"],
            **({"why": match["why"]} if match["why"] else {}),
            "chapter": source,
        }
    ids = _ANY_ID.findall(text)
    if found != len(ids):
        raise ProseError(f"{source}: {len(ids)} ids, but {found} well-formed requirements: {ids}")


def stray_keywords(text: str) -> list[str]:
    """Lines with a key word in capitals outside of a requirement: normative text without an id."""
    return [
        line
        for line in text.splitlines()
        if _KEYWORD.search(line)
        and not _ANY_ID.match(line)
        and not line.startswith(("The key words", "> **[", "A peer conforms", "A SHOULD may"))
    ]


def chapters(version: str, root: Path = CHECKOUT) -> list[Path]:
    """The Markdown files of one version, in reading order."""
    return sorted((root / "spec" / version).glob("*.md"))


def collect(version: str, root: Path = CHECKOUT) -> dict[str, Any]:
    """The registry of one version, as it is written to `requirements.json`.

    Raises ProseError for a malformed or repeated requirement or an outcome that is not defined.
    """
    known = OUTCOMES["1.0"] | OUTCOMES.get(version, frozenset())
    requirements: dict[str, dict[str, Any]] = {}
    for path in chapters(version, root):
        source = f"spec/{version}/{path.name}"
        for requirement in requirements_in(path.read_text("utf-8"), source):
            if requirement["id"] in requirements:
                raise ProseError(f"{source}: {requirement['id']} stands twice")
            if unknown := set(requirement["acceptable"]) - known:
                raise ProseError(f"{source}: {requirement['id']} accepts {sorted(unknown)}")
            requirements[requirement["id"]] = requirement
    return {
        "$schema": "urn:splatbus:schema:requirements",
        "version": version,
        "requirements": list(requirements.values()),
    }


def examples(version: str, root: Path = CHECKOUT) -> list[Example]:
    """The byte-level examples of one version, as the prose shows them.

    Raises ProseError where the hexadecimal text is no hexadecimal text.
    """
    found = []
    for path in chapters(version, root):
        for match in _EXAMPLE.finditer(path.read_text("utf-8")):
            try:
                packet = bytes.fromhex(match["hex"])
            except ValueError as error:
                raise ProseError(f"{path.name}: example {match['name']}: {error}") from None
            found.append(Example(match["name"], match["json"].encode(), packet, path.name))
    return found


def fill_in_hex(text: str) -> str:
    """The chapter with each hexadecimal example made from its JSON example."""
    return _EXAMPLE.sub(
        lambda match: (
            match[0][: match.start("hex") - match.start()]
            + packet_hex(match["json"].encode())
            + "\n```"
        ),
        text,
    )


def rendered_registry(version: str, root: Path = CHECKOUT) -> str:
    """The text of `requirements.json` that the prose asks for."""
    return _as_text(collect(version, root))


def _as_text(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


def registry_path(version: str, root: Path = CHECKOUT) -> Path:
    """Where the registry of one version is kept."""
    return root / "schemas" / "splatbus_schemas" / version / "requirements.json"


def wanted_files(root: Path = CHECKOUT) -> dict[Path, str]:
    """Everything that the prose decides, by its place: the chapters themselves filled in."""
    filled = {p: fill_in_hex(p.read_text("utf-8")) for v in OUTCOMES for p in chapters(v, root)}
    spec = root / "spec"
    texts = {path.relative_to(spec).as_posix(): text for path, text in filled.items()}
    registries = {registry_path(v, root): rendered_registry(v, root) for v in OUTCOMES}
    return filled | registries | {spec / complete.PLACE: complete.document(texts)}


def made_of_schemas() -> dict[Path, str]:
    """What the schemas of the messages decide, by its place: the bundles and the metamodel."""
    package = CHECKOUT / "schemas" / "splatbus_schemas"
    bundles = {package / version / "bundle.json": _as_text(bundle(version)) for version in OUTCOMES}
    return {**bundles, package / "metamodel.json": _as_text(metamodel())}


def main(argv: list[str] | None = None) -> int:
    """Compare what is generated with its sources, or write it; 0 if they agree."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_schemas.prose", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--write", action="store_true", help="write instead of comparing")
    write = parser.parse_args(argv).write
    wanted = {**wanted_files(), **made_of_schemas()}
    stale = [p for p, text in wanted.items() if not p.exists() or p.read_text("utf-8") != text]
    for path in stale:
        print(f"{'wrote' if write else 'differs'}: {path.relative_to(CHECKOUT)}")
        if write:
            path.parent.mkdir(exist_ok=True)
            path.write_text(wanted[path], "utf-8")
    return 1 if stale and not write else 0


if __name__ == "__main__":
    sys.exit(main())
