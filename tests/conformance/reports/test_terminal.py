"""What a person reads: why checks were skipped, in which order failures stand, how they wrap."""

import io

import pytest
from splatbus_conformance.reports import terminal
from splatbus_conformance.reports.console import CleanConsole
from splatbus_conformance.reports.terminal import (
    SHOWN_WITH_BYTES,
    LiveProgress,
    print_end,
    print_failures,
    print_what_next,
    words,
)
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import EXIT_CONFORMING, Level, Result, Verdict
from splatbus_schemas.requirements import requirements

NO_ADAPTER = "only an adapter could show it: --adapter"
COMMAND = "splatbus-conformance replay splatbus-failures/FRM-3-bad.json --launch './viewer -h'"


def console(width: int = 80, *, terminal: bool = False, **environment: str) -> CleanConsole:
    return CleanConsole(
        file=io.StringIO(),
        width=width,
        force_terminal=terminal,
        _environ=environment,
    )


def text(out: CleanConsole) -> str:
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def failed(requirement: str, check: str = "check_it", level: Level = Level.WIRE, **more) -> Result:
    return Result(requirement, check, level, Verdict.FAIL, "it did [/] otherwise", **more)


def test_a_reason_for_skips_is_told_once_with_all_that_it_hid() -> None:
    out = console()
    live = LiveProgress(out)
    live.begin(dict.fromkeys(("check_a", "check_b", "check_c", "check_any_segmentation"), 1.0))
    for check, name in (("check_a", "CNV-1"), ("check_b", "CNV-2"), ("check_c", "CNV-1")):
        live.done(Result(name, check, Level.ADAPTER, Verdict.SKIP, NO_ADAPTER))
    live.done(Result("FRM-4", "check_any_segmentation", Level.WIRE, Verdict.PASS))
    assert NO_ADAPTER not in text(out)
    live.end()
    lines = text(out).splitlines()
    assert lines[0] == "   4/4  FRM-4   pass    any segmentation"
    assert f"   3  {NO_ADAPTER}" in lines
    assert "      CNV-1 CNV-2" in lines
    live.end()
    assert text(out).count(NO_ADAPTER) == 1, "told twice"


def test_what_another_check_has_judged_is_told_from_what_none_has() -> None:
    out = console()
    live = LiveProgress(out)
    live.begin({"check_a": 1.0, "check_b": 1.0})
    for name in ("CNV-1", "CNV-2"):
        live.done(Result(name, "check_a", Level.ADAPTER, Verdict.SKIP, NO_ADAPTER))
    live.done(Result("CNV-2", "check_b", Level.WIRE, Verdict.PASS))
    live.end()
    assert "      CNV-1 (CNV-2)" in text(out).splitlines()


def test_a_terminal_sees_what_runs_and_a_file_does_not() -> None:
    outs = console(terminal=True, TERM="xterm"), console()
    for out in outs:
        live = LiveProgress(out)
        live.begin({"check_any_segmentation": 1.0, "check_b": 3.0})
        live.start("check_any_segmentation", "FRM-4")
        live.end()
    assert "FRM-4 any segmentation" in text(outs[0])
    assert text(outs[1]) == ""


def test_how_long_is_left_is_told_by_what_checks_took_once(monkeypatch) -> None:
    now = 100.0
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    outs = console(terminal=True, TERM="xterm"), console()
    lives = [LiveProgress(out) for out in outs]
    for live in lives:
        live.begin({"check_a": 2.0, "check_b": 6.0})
    now = 120.0
    for live in lives:
        live.done(Result("FRM-4", "check_a", Level.WIRE, Verdict.PASS))
        live.end()
    assert all("about 60 s left" in text(out) for out in outs)


def test_failures_stand_in_the_order_in_which_to_look_at_them() -> None:
    out = console()
    results = [
        failed("CHN-9"),
        failed("FRM-2", RULE, Level.PASSIVE),
        Result("CHN-20", "check_it", Level.WIRE, Verdict.WARN, "it waited"),
        failed("FRM-3"),
    ]
    print_failures(out, results, requirements("1.1"))
    heads = [line.split()[1] for line in text(out).splitlines() if line[:5].strip() in HEADS]
    assert heads == ["FRM-2", "CHN-9", "FRM-3", "CHN-20"]
    assert text(out).count("may follow from FRM-2") == 1
    assert "it did [/] otherwise" in text(out), "what a testee sends is no markup"


HEADS = ("FAIL", "WARN")


@pytest.mark.parametrize("width", [40, 80, 120])
def test_text_wraps_below_itself_and_a_command_stays_in_one_piece(width: int) -> None:
    out = console(width)
    print_failures(out, [failed("FRM-3", replay=COMMAND)], requirements("1.1"))
    lines = text(out).splitlines()
    assert any(line.endswith(COMMAND) for line in lines), "to be copied"
    sentence = " ".join(requirements("1.1")["FRM-3"].sentence.split())
    at = next(place for place, line in enumerate(lines) if "the standard" in line)
    told = [line for line in lines[at:] if line.startswith(" " * 17) or "the standard" in line]
    assert sentence in " ".join(line[17:] for line in told)
    assert all(len(line) <= width for line in lines if COMMAND not in line)


def test_the_bytes_of_the_first_failures_are_shown_and_the_commands_of_all() -> None:
    out = console()
    many = [
        failed(f"CHN-{number}", evidence=("00 00 00 26",), replay=f"replay {number}")
        for number in range(1, SHOWN_WITH_BYTES + 3)
    ]
    print_failures(out, many, requirements("1.1"))
    assert text(out).count("00 00 00 26") == SHOWN_WITH_BYTES
    assert text(out).count("see it again") == len(many)


@pytest.mark.parametrize("width", [40, 80])
def test_what_a_failure_is_about_is_marked_in_the_margin_and_never_cut(width: int) -> None:
    told = "".join(f"{number:04} " for number in range(200))
    evidence = ("   1.0000 s  ipc #1  before", f">            {told}", f"             {told}")
    out = console(width)
    print_failures(out, [failed("FRM-3", evidence=evidence)], requirements("1.1"))
    lines = text(out).splitlines()
    marked = [line[5:].strip() for line in lines if line.startswith("    >")]
    assert "".join(marked).replace(" ", "") == told.replace(" ", "")
    assert all(len(line) <= width for line in lines)
    coloured = console(width, terminal=True, TERM="xterm")
    print_failures(coloured, [failed("FRM-3", evidence=evidence)], requirements("1.1"))
    assert "\x1b[1;31m    >" in text(coloured)


def test_what_to_start_with_comes_last_but_for_the_verdict() -> None:
    out = console(120)
    results = [failed("CHN-9"), failed("FRM-2", RULE, Level.PASSIVE)]
    print_what_next(out, results, ["The two ports may be swapped."], recorded=False)
    said = text(out)
    assert said.index("swapped") < said.index("Start with FRM-2") < said.index("--record FOLDER")
    assert "--select CHN-9 --record" in said, "a rule cannot be played again by itself"


def test_colour_is_for_terminals_that_want_it() -> None:
    plain, coloured, refused = (
        console(),
        console(terminal=True, TERM="xterm"),
        console(terminal=True, TERM="xterm", NO_COLOR="1"),
    )
    for out in (plain, coloured, refused):
        print_end(out, "conforming at L1", "8 cases", EXIT_CONFORMING)
    assert "\x1b" not in text(plain)
    assert "\x1b[1;32m" in text(coloured)
    assert "32m" not in text(refused)


def test_names_of_checks_read_as_words() -> None:
    assert words("check_unity_s_row") == "unity's row"
    assert words("check_survives_bad_replies_of_1_1") == "survives bad replies of 1.1"
    assert words("check_computes_in_64_bits") == "computes in 64 bits"
