"""Where the files of the repository stand in the site."""

import posixpath
import re
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

FRONT = "conformance/site/index.md"
FOLDERS = (
    "spec",
    "schemas",
    "conformance",
    "reference_server",
    "reference_client",
    "benchmarks",
)
SHORT_TITLES = {"complete": "In one piece"}
PARTS = ("conformance/site/", "spec/editions/parts/")
"""Folders of what is only part of other pages."""
RAW = ("schemas/splatbus_schemas/**/*.json", "spec/vectors/*.json")


def prose(root: Path) -> dict[str, str]:
    """The Markdown files of the repository that are pages of the site, by their paths."""
    patterns = ("*.md", *(f"{folder}/**/*.md" for folder in FOLDERS))
    found = (path for pattern in patterns for path in root.glob(pattern))
    paths = sorted(path.relative_to(root).as_posix() for path in found)
    return {
        path: (root / path).read_text("utf-8")
        for path in paths
        if path == FRONT or not path.startswith(PARTS)
    }


def docname(source: str) -> str:
    """The name of a page, without an ending: `spec/1.0/index` for `spec/1.0/README.md`."""
    if source == FRONT:
        return "index"
    path = PurePosixPath(source)
    stem = "index" if path.stem == "README" and path.parent.name else path.stem
    return (path.parent / stem.lower().replace("_", "-")).as_posix()


def children(index: str, docnames: Iterable[str]) -> list[str]:
    """The pages directly below an index: those of its folder, then indexes of folders in it."""
    folder = posixpath.dirname(index)
    pages, folders = [], []
    for each in docnames:
        parent, stem = posixpath.split(each)
        if parent == folder and each != index:
            pages.append(each)
        elif stem == "index" and posixpath.dirname(parent) == folder and parent:
            folders.append(each)
    return [*sorted(pages, key=_naturally), *sorted(folders, key=_naturally)]


def contents(index: str, docnames: Iterable[str]) -> str:
    """The table of contents that Sphinx wants at the end of an index, shown beside the pages."""
    below = "".join(f"{_entry(each)}\n" for each in children(index, docnames))
    return f"\n```{{toctree}}\n:hidden:\n\n{below}```\n" if below else ""


def staged(pages: Mapping[str, str]) -> dict[str, str]:
    """The pages by docname, each index with its table of contents."""
    named = {docname(source): text for source, text in pages.items()}
    return {
        name: text + contents(name, named) if name.endswith("/index") else text
        for name, text in named.items()
    }


def _entry(name: str) -> str:
    title = SHORT_TITLES.get(PurePosixPath(name).parent.name)
    return f"{title} </{name}>" if title else f"/{name}"


def _naturally(text: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]
