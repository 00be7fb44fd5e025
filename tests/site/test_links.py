"""Links between files become links between pages."""

from pathlib import Path

import pytest

from conformance.site.splatbus_site.links import relinked, targets

PAGES = frozenset({"README.md", "spec/README.md", "spec/1.0/README.md", "spec/1.0/02-framing.md"})


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "spec" / "data").mkdir(parents=True)
    (tmp_path / "spec" / "limits.json").write_text("{}", "utf-8")
    (tmp_path / "spec" / "picture.png").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("source", "before", "after"),
    [
        ("README.md", "[a](spec/README.md)", "[a](spec/index.md)"),
        ("README.md", "[a](spec/1.0/)", "[a](spec/1.0/index.md)"),
        ("spec/README.md", "[`1.0/`](1.0/README.md#x)", "[`1.0/`](1.0/index.md#x)"),
        ("spec/1.0/02-framing.md", "[a](../../README.md#b)", "[a](../../readme.md#b)"),
        ("spec/1.0/02-framing.md", "[a](#b)", "[a](#b)"),
        ("spec/README.md", "[a](data/)", "a"),
        ("spec/README.md", "[a](nothing.md)", "[a](nothing.md)"),
        ("README.md", "[a](https://example.org/b.md)", "[a](https://example.org/b.md)"),
        ("README.md", "```\n[a](spec/README.md)\n```", "```\n[a](spec/README.md)\n```"),
    ],
)
def test_a_link_leads_to_the_page(source: str, before: str, after: str, root: Path) -> None:
    assert relinked(source, before, PAGES, root) == (after, set(), set())


def test_a_file_keeps_its_place(root: Path) -> None:
    text, files, _ = relinked("spec/1.0/02-framing.md", "[`a`](../limits.json)", PAGES, root)
    assert text == '<a href="../limits.json">`a`</a>'
    assert files == {"spec/limits.json"}


def test_a_page_that_moves_takes_its_files_along(root: Path) -> None:
    text, files, shown = relinked(
        "conformance/site/index.md", "![a](../../spec/picture.png)", PAGES, root
    )
    assert text == "![a](spec/picture.png)"
    assert (files, shown) == (set(), {"spec/picture.png"})


def test_a_picture_that_is_led_to_lies_beside_the_pages(root: Path) -> None:
    _, files, shown = relinked("README.md", "[a](spec/picture.png)", PAGES, root)
    assert (files, shown) == ({"spec/picture.png"}, set())


def test_targets_are_those_outside_of_fences() -> None:
    assert targets("[a](b) ![c](d)\n```\n[e](f)\n```\n[[g]](h)") == ["b", "d", "h"]
