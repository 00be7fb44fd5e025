"""Links between files of the repository, turned into links between pages of the site."""

import html
import posixpath
import re
from pathlib import Path

from .layout import docname
from .markdown import outside_of_fences, without_fences

_LINK = re.compile(
    r"(?P<image>!?)\[(?P<text>(?:[^\[\]]|!?\[[^\]]*\](?:\([^)]*\))?)*)\]\((?P<target>[^)\s]+)\)"
)
_ELSEWHERE = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


def targets(text: str) -> list[str]:
    """The target of each link and picture, outside of fenced blocks."""
    return [link["target"] for link in _LINK.finditer(without_fences(text))]


def is_elsewhere(target: str) -> bool:
    """Whether a link leads out of the repository."""
    return _ELSEWHERE.match(target) is not None


def resolved(source: str, target: str) -> str:
    """The path, from the root of the repository, of what a relative link leads to."""
    path = target.partition("#")[0]
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), path)) if path else source


def relinked(
    source: str, text: str, pages: frozenset[str], root: Path
) -> tuple[str, set[str], set[str]]:
    """The text as the site needs it, the files that it leads to, and the pictures that it shows.

    A link to a page becomes one to its docname; one to another file keeps its path, which the file
    has in the site as well; one to a folder is only its text. A link to nothing stays: Sphinx will
    complain of it.
    """
    files: set[str] = set()
    shown: set[str] = set()
    here = posixpath.dirname(docname(source))

    def replaced(match: re.Match[str]) -> str:
        target = match["target"]
        if is_elsewhere(target) or target.startswith("#"):
            return match[0]
        path = resolved(source, target)
        if (index := posixpath.join(path, "README.md")) in pages:
            path = index
        if path in pages:
            mark, fragment = target.partition("#")[1:]
            page = posixpath.relpath(docname(path) + ".md", here or ".")
            return f"[{match['text']}]({page}{mark}{fragment})"
        if (root / path).is_dir():
            return match["text"]
        if not (root / path).is_file():
            return match[0]
        place = posixpath.relpath(path, here or ".")
        if match["image"]:
            shown.add(path)
            return f"![{match['text']}]({place})"
        files.add(path)
        return f'<a href="{html.escape(place)}">{match["text"]}</a>'

    return outside_of_fences(lambda part: _LINK.sub(replaced, part), text), files, shown
