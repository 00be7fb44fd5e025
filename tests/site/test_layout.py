"""Where files stand in the site, and in what order."""

import pytest

from conformance.site.splatbus_site.layout import FRONT, children, docname, staged
from conformance.site.splatbus_site.markdown import anchors, demoted, table


@pytest.mark.parametrize(
    ("source", "name"),
    [
        (FRONT, "index"),
        ("README.md", "readme"),
        ("spec/1.0/README.md", "spec/1.0/index"),
        ("conformance/KILL_MATRIX.md", "conformance/kill-matrix"),
        ("spec/1.0/02-framing.md", "spec/1.0/02-framing"),
        ("schemas/1.1/set_time.md", "schemas/1.1/set-time"),
    ],
)
def test_each_file_has_a_name(source: str, name: str) -> None:
    assert docname(source) == name


def test_an_index_lists_its_folder_by_number_and_then_the_folders_in_it() -> None:
    names = "s/index s/a/index s/a/b/index s/10-x s/9-y s/annex t/index index".split()
    assert children("s/index", names) == ["s/9-y", "s/10-x", "s/annex", "s/a/index"]


def test_only_an_index_gets_a_table_of_contents() -> None:
    pages = staged({"spec/README.md": "# A\n", "spec/B.md": "# B\n"})
    assert pages["spec/b"] == "# B\n"
    assert pages["spec/index"] == "# A\n\n```{toctree}\n:hidden:\n\n/spec/b\n```\n"


def test_anchors_are_those_of_code_hosts() -> None:
    text = "# A, `b` & [c](d)!\n## x_y 1.2\n## Same\n## Same\n```\n# none\n```\n"
    assert anchors(text) == ["a-b--c", "x_y-12", "same", "same-1"]


def test_headings_go_down_but_not_what_looks_like_one() -> None:
    assert demoted("# A\n```\n# b\n```\n## C") == "## A\n```\n# b\n```\n### C"


def test_a_cell_is_one_line_and_holds_its_bars() -> None:
    assert table(("a", "b"), [("x |\n y", "z")]) == "| a | b |\n| --- | --- |\n| x \\| y | z |\n"
