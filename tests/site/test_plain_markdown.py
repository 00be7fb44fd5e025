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


@pytest.mark.parametrize("source", TEXTS)
def test_every_link_leads_to_a_file_and_a_heading(source: str) -> None:
    for target in links.targets(TEXTS[source]):
        if not links.is_elsewhere(target):
            path, fragment = links.resolved(source, target), target.partition("#")[2]
            assert (ROOT / path).exists(), target
            assert not fragment or fragment in markdown.anchors(TEXTS[path]), target


def test_links_and_anchors_are_those_of_code_hosts_outside_of_fences() -> None:
    assert links.targets("[a](b) ![c](d)\n```\n[e](f)\n```\n[[g]](h)") == ["b", "d", "h"]
    text = "# A, `b` & [c](d)!\n## x_y 1.2\n## Same\n## Same\n```\n# none\n```\n"
    assert markdown.anchors(text) == ["a-b--c", "x_y-12", "same", "same-1"]
    assert links.resolved("b/c.md", "../a.md#one") == "a.md"
    assert links.resolved("b/c.md", "#one") == "b/c.md"
