"""Pages about the requirements: 1.0 in one piece, and an index of every sentence."""

import posixpath
import re
from collections.abc import Iterable, Mapping

from splatbus_schemas import VERSIONS, requirements
from splatbus_schemas.editions import PLACES
from splatbus_schemas.requirements import Requirement

from .markdown import anchor, demoted, headings, table

INDEX = "spec/REQUIREMENTS.md"
WHOLE = {version: f"spec/{version}/complete/README.md" for version in VERSIONS}
REPEATING = {*WHOLE.values(), *(f"spec/{place}" for place in PLACES.values())}
NOT_SEARCHED = "---\nnosearch: true\n---\n\n"
_CHAPTER_LINK = re.compile(r"\]\(([\w-]+\.md)\)")


def in_one_piece(version: str, pages: Mapping[str, str]) -> str:
    """All chapters of one version, the introduction first."""
    folder = f"spec/{version}"
    paths = [path for path in pages if posixpath.dirname(path) == folder]
    chapters = sorted(paths, key=lambda path: (not path.endswith("README.md"), path))
    starts = {posixpath.basename(path): anchor(headings(pages[path])[0]) for path in chapters}

    def within(match: re.Match[str]) -> str:
        return f"](#{starts[match[1]]})" if match[1] in starts else match[0]

    def moved(text: str) -> str:
        return _CHAPTER_LINK.sub(within, demoted(text)).replace("](../", "](../../")

    return "\n".join(
        [
            f"# SplatBus protocol, version {version}, complete\n",
            f"All chapters of [{version}](../README.md), one after the other.\n",
            *(moved(pages[path]) for path in chapters),
        ]
    )


def index(pages: Mapping[str, str]) -> str:
    """Every requirement of every version with its sentence, chapter by chapter."""
    page = (
        "# All requirements\n\n"
        "Each sentence that binds somebody, with a link to where it stands; "
        "[how to read one](1.0/README.md#12-how-to-read-a-requirement). "
        "What judges it is in the [coverage table](../conformance/COVERAGE.md).\n\n"
        '<div class="row-filter" data-what="requirements"></div>\n'
    )
    for version in VERSIONS:
        own = [each for each in requirements(version).values() if f"/{version}/" in each.chapter]
        page += f"\n## {version}: {len(own)} requirements\n"
        for chapter, found in by_chapter(own).items():
            page += f"\n### {headings(pages[chapter])[0]} ({version})\n\n"
            page += table(("id", "sentence", "binds", "acceptable"), map(_row, found))
    return page


def by_chapter(found: Iterable[Requirement]) -> dict[str, list[Requirement]]:
    """The requirements of each chapter, in the order of the chapters."""
    chapters: dict[str, list[Requirement]] = {}
    for each in found:
        chapters.setdefault(each.chapter, []).append(each)
    return chapters


def _row(each: Requirement) -> tuple[str, ...]:
    return each.id, each.sentence, ", ".join(each.binds), ", ".join(each.acceptable)
