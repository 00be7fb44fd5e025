"""Release notes, from the changelog: `python -m tests.release_notes` prints those of this version.

The exit status is 1 if the changelog does not tell of it, or still calls it unreleased.
"""

import re
import sys
import tomllib
from itertools import chain, islice
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADING = re.compile(r"^## (?P<version>\S+) \((?P<day>[^)]*)\)\n", re.MULTILINE)
DAY = re.compile(r"\d{4}-\d{2}-\d{2}")


class NotReady(Exception):  # noqa: N818 - a finding, no error of ours
    """The changelog is not that of a release of this version; the message says why."""


def release_notes(changelog: str, version: str) -> str:
    """The text under the topmost heading of a changelog, in Markdown.

    Raises NotReady where that heading is not of `version`, names no day, or has no text below.
    """
    first, following = islice(chain(HEADING.finditer(changelog), (None, None)), 2)
    if first is None or first["version"] != version:
        topmost = first["version"] if first else "no version"
        raise NotReady(f"pyproject.toml says {version}, and the changelog begins with {topmost}")
    text = changelog[first.end() : following.start() if following else None].strip()
    if not text:
        raise NotReady(f"the changelog says nothing about {version}")
    if not DAY.fullmatch(first["day"]):
        raise NotReady(f"the changelog calls {version} {first['day']}: write the day there")
    return text + "\n"


def main() -> int:
    """Print the release notes of the version in pyproject.toml, or say what is missing."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    try:
        notes = release_notes((ROOT / "CHANGELOG.md").read_text("utf-8"), project["version"])
    except NotReady as reason:
        print(reason, file=sys.stderr)
        return 1
    sys.stdout.write(notes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
