"""SECURITY.md names a test for each limit, and each is there."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "SECURITY.md").read_text("utf-8")


def test_every_limit_has_a_test_that_is_there() -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", TEXT)
    assert len(named) > 30
    for path, name in named:
        assert re.search(
            rf"^    def {name}\(|^def {name}\(", (ROOT / path).read_text("utf-8"), re.M
        ), name


def test_every_table_of_limits_has_a_test_in_each_row() -> None:
    limits = TEXT[TEXT.index("## Limits") : TEXT.index("## How this is tested")]
    rows = re.findall(r"^\| (?!limit |---).*\|$", limits.replace("|---", "| ---"), re.MULTILINE)
    assert rows
    assert [row for row in rows if "tests/" not in row] == []
