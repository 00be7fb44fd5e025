"""Release notes are what the changelog tells of this version, and nothing else."""

import tomllib

import pytest

from tests.release_notes import HEADING, ROOT, NotReady, release_notes

CHANGELOG = """\
# Changelog

All changes.

## 0.2.0 (2027-01-31)

### Wire

- Faster.

## 0.1.0 (2026-11-21)

- First.
"""


def test_they_are_the_topmost_section_without_its_heading() -> None:
    assert release_notes(CHANGELOG, "0.2.0") == "### Wire\n\n- Faster.\n"
    assert release_notes(CHANGELOG[CHANGELOG.index("## 0.1.0") :], "0.1.0") == "- First.\n"


@pytest.mark.parametrize(
    ("changelog", "version", "complaint"),
    [
        (CHANGELOG, "0.1.0", r"pyproject\.toml says 0\.1\.0, .* begins with 0\.2\.0"),
        ("# Changelog\n", "0.1.0", "begins with no version"),
        ("## 0.1.0 (2026-11-21)\n\n## 0.0.9 (2026-11-01)\n\n- It.\n", "0.1.0", "says nothing"),
        (CHANGELOG.replace("2027-01-31", "unreleased"), "0.2.0", "calls 0.2.0 unreleased"),
    ],
)
def test_what_is_not_ready_is_refused(changelog: str, version: str, complaint: str) -> None:
    with pytest.raises(NotReady, match=complaint):
        release_notes(changelog, version)


def test_the_changelog_begins_with_the_version_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    topmost = next(HEADING.finditer((ROOT / "CHANGELOG.md").read_text("utf-8")))
    assert topmost["version"] == project["version"]
