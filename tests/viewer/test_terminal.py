"""What is written to a terminal, letter by letter."""

import io

import pytest
from splatbus_viewer.terminal import Lines, bar, columns


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_columns_are_empty_at_the_least_and_full_at_the_most():
    assert columns([0, 1, 2, 3, 4], 0, 4) == " ▂▄▆█"
    assert columns([7, 7], 7, 7) == "  "
    assert columns([0, 1, 1000], 0, 1000) == " ▁█", "what is not nothing is seen"
    assert columns([-1.7e308, 0.0, 1.7e308], -1.7e308, 1.7e308) == " ▄█"


@pytest.mark.parametrize(("share", "text"), [(0, ""), (1, "████"), (0.5, "██"), (1 / 32, "▏")])
def test_a_bar_takes_its_share(share, text):
    assert bar(share, 4) == text


def test_lines_are_written_over_on_a_terminal_only(monkeypatch):
    monkeypatch.setenv("COLUMNS", "6")
    monkeypatch.setenv("LINES", "4")
    for out, written in [
        (Terminal(), "\x1b[Ja\nb\n\x1b[2F\x1b[J12345\nb\nc\n"),
        (io.StringIO(), "a\nb\n1234567\nb\nc\nd\n"),
    ]:
        lines = Lines(out)
        lines.write(["a", "b"])
        lines.write(["1234567", "b", "c", "d"])
        assert out.getvalue() == written
