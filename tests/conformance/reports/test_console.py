"""The console: whatever it is told, nothing of it acts on a terminal or in a job of a CI system."""

import ast
import io
import re
from pathlib import Path

import pytest
import splatbus_conformance
from hypothesis import example, given
from hypothesis import strategies as st
from rich.live import Live
from rich.table import Table
from rich.text import Text
from splatbus_conformance.reports.console import CleanConsole

SOURCES = Path(splatbus_conformance.__file__).parent
ORDERS = ("::error::x", "##[error]x", "##vso[task.complete]x", "::set-output name=a::b")
ORDER = re.compile(r"^\s*::|##\[|##\w+\[", re.MULTILINE)
RAW = {
    "reports/console.py": "it is the console",
    "observe/relay_process.py": "it speaks to the process that shows it, in lines that are clean",
    "oracle/vectors/__main__.py": "it names a file of this project",
    "images/memory/cuda_stand_in/__main__.py": "a shell reads it",
    "minimal_client.py": "it is a client, which needs nothing of ours",
}
"""What writes to a stream by itself, and why it may."""


def shown(*told: object, width: int = 40, colour: bool = False, **how: object) -> str:
    text = io.StringIO()
    out = CleanConsole(file=text, width=width, force_terminal=colour, _environ={"TERM": "xterm"})
    for each in told:
        out.print(each, **how)  # type: ignore[arg-type]
    return text.getvalue()


def table(*cells: str | Text) -> Table:
    found = Table.grid()
    found.add_row(*cells)
    return found


def assert_harmless(text: str) -> None:
    assert all(each.isprintable() or each == "\n" for each in text), text
    assert not ORDER.search(text), text


@example("a" * 39 + " ::error::x")
@example("\n ::error::x\n##[x]")
@example("##")
@given(st.text(st.sampled_from("::##[]vso a\n\r\x1b\x9b\u202e\ud800{}\\/")) | st.text())
def test_no_text_acts(text: str) -> None:
    for each in (text, Text(text), table(text, text), Text.assemble((text, "bold"), (text, "dim"))):
        for how in ({}, {"soft_wrap": True}, {"no_wrap": True, "overflow": "ellipsis"}):
            assert_harmless(shown(each, text, **how))


@pytest.mark.parametrize("order", ORDERS)
def test_no_order_comes_to_begin_a_line_by_wrapping_or_is_put_together_of_pieces(
    order: str,
) -> None:
    for width in (20, 40):
        for before in range(width + 1):
            text = f"{'a' * before} {order}"
            assert_harmless(shown(text, table(Text(text), text), width=width))
    for cut in range(1, 6):
        told = shown(Text.assemble((order[:cut], "bold"), (order[cut:], "dim")))
        assert_harmless(told)
        assert told.replace("\\", "") == f"{order}\n"


def test_a_screen_that_is_drawn_again_and_again_is_clean_too() -> None:
    hostile, text = "\x1b[2J\x9b31m\x1b]0;x\x07\r\u202e\u200b\u2028", io.StringIO()
    out = CleanConsole(file=text, width=80, force_terminal=True, _environ={"TERM": "xterm"})
    with Live(Text(hostile), console=out, auto_refresh=False, redirect_stdout=False) as live:
        live.update(Text(f"{hostile} again"), refresh=True)
        out.print(hostile)
    assert r"\x1b[2J" in text.getvalue()
    assert not re.search("\x1b\\[2J|\x1b]|[\x9b\x07\u202e\u200b\u2028]", text.getvalue())


def test_its_own_colours_stay_and_markup_is_text() -> None:
    said = shown(Text.assemble(("FAIL", "bold red"), " \x1b[32mpass"), colour=True)
    assert "\x1b[1;31mFAIL" in said
    assert r"\x1b[32mpass" in said
    assert shown("[red]a[/] [/x] :boom: [link=x]y[/]") == "[red]a[/] [/x] :boom: [link=x]y[/]\n"


def test_nobody_writes_around_it() -> None:
    around = re.compile(r"(print|pprint|Console|rich\.print|traceback\.print.*|sys\.std\w+\.write)")
    found = {
        path.relative_to(SOURCES).as_posix()
        for path in SOURCES.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call) and around.fullmatch(ast.unparse(node.func))
    }
    assert found == set(RAW)
