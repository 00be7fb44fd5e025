"""Read the requirements and the byte-level examples out of the specification's prose.

The prose is the only source of requirements (spec/README.md, "Ids"). This module turns it into the
`requirements.json` that programs read, makes the packet of each JSON example, draws the axes, and
keeps the editions, which are made of the same chapters, and what is made of the schemas for
generators.

Run `python -m splatbus_schemas.prose` in a checkout to compare, with `--write` to write.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_schemas import editions, pictures
from splatbus_schemas.data import read_json
from splatbus_schemas.model.bundle import bundle

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
_STATUS = re.compile(r"^\*\*Status: (.+)\.\*\*", re.MULTILINE)
ANY_ID = re.compile(r"^\*\*\[([^\]]+)\]\*\*", re.MULTILINE)
KEYWORD = re.compile(r"\b(?:MUST NOT|MUST|SHOULD NOT|SHOULD|MAY)\b")
_EXAMPLE = re.compile(
    r"(?P<shown>```json example=(?P<name>\w+)\n(?P<json>[^\n]+)\n```\n\n)"
    r"(?:```hex example=(?P=name)\n[^`]*\n```|The packet: \[`[^`]*`\]\(.*\)\.)"
)
PACKETS = "vectors/packets.json"
_LIMITS = re.compile(
    r"^(\| limit \| value \| requirement \|\n\|---\|---\|---\|\n)(?:\|.*\n)+", re.MULTILINE
)
LONGEST_DUMP = 5
"""Lines of hexadecimal text that the prose shows; what is longer is in the vectors alone."""


class ProseError(ValueError):
    """The prose breaks its own form; the message names the file and what is wrong."""


class Example(NamedTuple):
    """A payload as the prose shows it."""

    name: str
    payload: bytes
    source: str

    @property
    def packet(self) -> bytes:
        """The payload behind its length (FRM-1)."""
        return len(self.payload).to_bytes(4, "little") + self.payload

    @property
    def dump(self) -> str:
        """The packet as pairs of hexadecimal digits, 32 bytes a line."""
        lines = (self.packet[i : i + 32] for i in range(0, len(self.packet), 32))
        return "\n".join(line.hex(" ") for line in lines)


def requirements_in(text: str, source: str) -> Iterator[dict[str, Any]]:
    """Yield each requirement of one chapter as the object that `requirements.json` holds.

    Raises ProseError where a paragraph with an id lacks its Binds line, or does not hold exactly
    one key word.
    """
    found = 0
    for match in _REQUIREMENT.finditer(text):
        found += 1
        keywords = set(KEYWORD.findall(match["sentence"]))
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
    ids = ANY_ID.findall(text)
    if found != len(ids):
        raise ProseError(f"{source}: {len(ids)} ids, but {found} well-formed requirements: {ids}")


def chapters(version: str, root: Path = CHECKOUT) -> list[Path]:
    """The Markdown files of one version, in reading order; its errata are no part of its text."""
    folder = root / "spec" / version
    return sorted(set(folder.glob("*.md")) - {folder / "errata.md"})


def _status(version: str, root: Path) -> str:
    said = _STATUS.search((root / "spec" / version / "README.md").read_text("utf-8"))
    if said is None:
        raise ProseError(f"spec/{version}/README.md: no line says the status")
    return said[1]


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
        "status": _status(version, root),
        "requirements": list(requirements.values()),
    }


def examples(version: str, root: Path = CHECKOUT) -> list[Example]:
    """The byte-level examples of one version, as the prose shows them."""
    return [
        Example(match["name"], match["json"].encode(), path.name)
        for path in chapters(version, root)
        for match in _EXAMPLE.finditer(path.read_text("utf-8"))
    ]


def fill_in_packets(text: str, version: str) -> str:
    """The chapter with each JSON example followed by its packet, or by where that is."""

    def filled(match: re.Match[str]) -> str:
        dump = Example(match["name"], match["json"].encode(), "").dump
        if dump.count("\n") < LONGEST_DUMP:
            return f"{match['shown']}```hex example={match['name']}\n{dump}\n```"
        return f"{match['shown']}The packet: [`{version}/{match['name']}`](../{PACKETS})."

    return _EXAMPLE.sub(filled, text)


def rendered_packets(root: Path = CHECKOUT) -> str:
    """The text of the vectors that hold the packet of each example."""
    document = {
        "$schema": "vectors.schema.json",
        "name": "packets",
        "version": "1.0",
        "description": (
            "The examples of the specification, by version and name: `payload` is the text, `hex` "
            "the whole packet. Encode the bytes of each payload and compare; hand each packet to "
            "your decoder, and then to what reads messages."
        ),
        "requirements": ["FRM-1", "JSN-1"],
        "cases": [
            {
                "name": f"{version}/{example.name}",
                **({"since": version} if version != "1.0" else {}),
                "requirement": "FRM-1",
                "payload": example.payload.decode(),
                "hex": example.packet.hex(),
            }
            for version in OUTCOMES
            for example in examples(version, root)
        ],
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def rendered_registry(version: str, root: Path = CHECKOUT) -> str:
    """The text of `requirements.json` that the prose asks for."""
    return _as_text(collect(version, root))


def _as_text(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


def registry_path(version: str, root: Path = CHECKOUT) -> Path:
    """Where the registry of one version is kept."""
    return root / "schemas" / "splatbus_schemas" / version / "requirements.json"


def filled_in(root: Path = CHECKOUT) -> dict[Path, str]:
    """The chapters of all versions, with the packets of their examples and the limits that are new
    in them, by their places.
    """
    filled = {
        p: fill_in_packets(p.read_text("utf-8"), v) for v in OUTCOMES for p in chapters(v, root)
    }
    for path in chapters("1.1", root):  # 1.0 is final, to the letter
        filled[path] = fill_in_limits(filled[path], "1.1")
    return filled


def fill_in_limits(text: str, version: str) -> str:
    """A chapter whose table of limits has those that are new in its version."""
    rows = [
        (f"`{name}`", f"{Decimal(str(it['value'])).normalize():f}", ", ".join(it["requirements"]))
        for name, it in read_json("limits.json")["limits"].items()
        if it["since"] == version
    ]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return _LIMITS.sub(lambda head: head[1] + table, text)


def documents(root: Path = CHECKOUT) -> dict[str, str]:
    """The editions, and all of the standard on one page, by their places in `spec/`."""
    spec = root / "spec"
    parts = {path: path.read_text("utf-8") for path in (spec / editions.PARTS).glob("*.md")}
    texts = {p.relative_to(spec).as_posix(): text for p, text in (filled_in(root) | parts).items()}
    return editions.documents(texts)


def wanted_files(root: Path = CHECKOUT) -> dict[Path, str]:
    """Everything that the prose decides, by its place: the chapters themselves filled in."""
    spec, filled = root / "spec", filled_in(root)
    registries = {registry_path(v, root): rendered_registry(v, root) for v in OUTCOMES}
    generated = {
        PACKETS: rendered_packets(root),
        pictures.PLACE: pictures.axes(filled[spec / pictures.TABLE]),
        **documents(root),
    }
    del generated[editions.PLACES[""]]  # which only repeats: the site has it
    return filled | registries | {spec / place: text for place, text in generated.items()}


def made_of_schemas() -> dict[Path, str]:
    """What the schemas of the messages decide, by its place: the bundles."""
    package = CHECKOUT / "schemas" / "splatbus_schemas"
    return {package / version / "bundle.json": _as_text(bundle(version)) for version in OUTCOMES}


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
