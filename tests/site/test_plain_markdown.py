"""The Markdown files of the repository, read as they are: every link leads somewhere."""

from pathlib import Path

import pytest

from conformance.site.splatbus_site import layout, links, markdown

ROOT = Path(__file__).resolve().parents[2]
TEXTS = {
    path.relative_to(ROOT).as_posix(): path.read_text("utf-8")
    for pattern in ("*.md", *(f"{folder}/**/*.md" for folder in (*layout.FOLDERS, "tests")))
    for path in sorted(ROOT.glob(pattern))
    if path != ROOT / layout.FRONT  # a page of the site alone; its links are tested there
}


def dangling(source: str, text: str, texts: dict[str, str], root: Path) -> list[str]:
    """The links of a file that lead nowhere in a checkout, or to a heading that is not there."""
    found = []
    for target in links.targets(text):
        if links.is_elsewhere(target):
            continue
        path, fragment = links.resolved(source, target), target.partition("#")[2]
        in_vain = fragment and fragment not in markdown.anchors(texts.get(path, ""))
        if in_vain or not (root / path).exists():
            found.append(target)
    return found


def test_there_is_something_to_read() -> None:
    assert "spec/1.0/02-framing.md" in TEXTS
    assert sum(len(links.targets(text)) for text in TEXTS.values()) > 200


@pytest.mark.parametrize("source", TEXTS)
def test_every_link_leads_to_a_file_and_a_heading(source: str) -> None:
    assert dangling(source, TEXTS[source], TEXTS, ROOT) == []


def test_what_dangles_is_found(tmp_path: Path) -> None:
    texts = {
        "a.md": "# One\n\n```\n# no heading\n[no link](x)\n```\n",
        "b/c.md": "# Two\n# Two\n",
    }
    (tmp_path / "b").mkdir()
    for path, text in texts.items():
        (tmp_path / path).write_text(text, "utf-8")
    for good in ("#one", "a.md", "b/", "https://example.org"):
        assert dangling("a.md", f"[x]({good})", texts, tmp_path) == []
    for bad in ("#no-heading", "#two", "c.md", "b/#one", "a.md#One"):
        assert dangling("a.md", f"![x](a.md) [`x`]({bad})", texts, tmp_path) == [bad]
    assert dangling("b/c.md", "[x](../a.md#one) [x](#two-1)", texts, tmp_path) == []
