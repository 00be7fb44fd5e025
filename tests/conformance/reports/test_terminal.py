"""What a person reads: why checks were skipped, in which order failures stand, how they wrap."""

import io
import re
from typing import Any

import pytest
from splatbus_conformance.reports import terminal
from splatbus_conformance.reports.console import CleanConsole
from splatbus_conformance.reports.terminal import (
    SHOWN_WITH_BYTES,
    LiveProgress,
    print_end,
    print_failures,
    print_unseen,
    print_what_next,
    words,
)
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_schemas.requirements import requirements

KNOWN = requirements("1.1")
NO_ADAPTER = "only an adapter could show it: --adapter"
COMMAND = "splatbus-conformance replay splatbus-failures/FRM-3-bad.json --launch './viewer -h'"
TERMINAL = {"force_terminal": True, "_environ": {"TERM": "xterm"}}


def console(width: int = 80, **options: Any) -> CleanConsole:
    return CleanConsole(**{"file": io.StringIO(), "width": width, "_environ": {}} | options)


def text(out: CleanConsole) -> str:
    assert isinstance(out.file, io.StringIO)
    return out.file.getvalue()


def failed(
    requirement: str, check: str = "check_it", level: Level = Level.WIRE, **more: Any
) -> Result:
    return Result(requirement, check, level, Verdict.FAIL, "it did [/] otherwise", **more)


def test_what_runs_is_told_as_it_goes_and_why_checks_were_skipped_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 100.0
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now)
    outs = console(), console(**TERMINAL)
    lives = [LiveProgress(out) for out in outs]
    for live in lives:
        live.begin({"check_a": 2.0, "check_b": 1.0, "check_any_segmentation": 2.0, "check_c": 5.0})
        for name in ("CNV-1", "CNV-2", "CNV-1"):
            live.done(Result(name, "check_b", Level.ADAPTER, Verdict.SKIP, NO_ADAPTER))
        live.start("check_any_segmentation", "FRM-4")
        live.done(Result("CNV-2", "check_a", Level.WIRE, Verdict.PASS))
    now = 120.0
    for live in lives:
        live.done(Result("FRM-4", "check_any_segmentation", Level.WIRE, Verdict.PASS))
        live.start("check_c", "FRM-5")
        live.end()
        live.end()
    assert text(outs[0]).splitlines() == [
        "   2/4  CNV-2   pass    a",
        "   3/4  FRM-4   pass    any segmentation",
        "   3/4  about 20 s left",
        *("", "Skipped, and why (ids in brackets were judged by other checks):"),
        *(f"   3  {NO_ADAPTER}", "      CNV-1 (CNV-2)"),
    ]
    assert re.search("3/4.*about 20 s left.*FRM-5 c", text(outs[1]))


def test_what_was_not_seen_is_told_by_reason() -> None:
    out = console()
    print_unseen(out, {"nowhere": ["SEC-2"], "why not": ["INI-1", "INI-2"]})
    assert text(out).splitlines() == [
        *("", "Not seen, and why:"),
        *("   2  why not", "      INI-1 INI-2", "   1  nowhere", "      SEC-2"),
    ]


def test_failures_stand_in_the_order_in_which_to_look_at_them_the_first_with_their_bytes() -> None:
    out = console(200)
    advice = Result("CHN-20", "check_it", Level.WIRE, Verdict.WARN, "it waited")
    many = [
        failed(f"CHN-{number}", evidence=("00 00 00 26",), replay=f"replay {number}", code="hangs")
        for number in range(1, SHOWN_WITH_BYTES + 3)
    ]
    print_failures(out, [advice, *many, failed("FRM-2", RULE, Level.PASSIVE)], KNOWN)
    lines = text(out).splitlines()
    heads = [line for line in lines if line[:4] in ("FAIL", "WARN")]
    assert heads[0] == "FAIL FRM-2  in what it sent (L0)"
    assert heads[1] == "FAIL CHN-1  it (L1, hangs)  may follow from FRM-2"
    assert heads[-1] == "WARN CHN-20  it (L1)"
    assert "  what came      it did [/] otherwise" in lines, "what a testee sends is no markup"
    assert lines.count("    00 00 00 26") == SHOWN_WITH_BYTES - 1
    assert text(out).count("see it again") == len(many)


@pytest.mark.parametrize("width", [40, 80])
def test_text_wraps_below_itself_and_what_a_failure_is_about_and_its_command_are_never_cut(
    width: int,
) -> None:
    told = "".join(f"{number:04} " for number in range(200))
    evidence = ("   1.0000 s  ipc #1  before" * 9, f">            {told}", f"             {told}")
    outs = console(width), console(width, **TERMINAL)
    for out in outs:
        print_failures(out, [failed("FRM-3", replay=COMMAND, evidence=evidence)], KNOWN)
    lines = text(outs[0]).splitlines()
    assert any(line.endswith(COMMAND) for line in lines), "to be copied"
    assert "  it accepts     closes" in lines
    assert all(len(line) <= width for line in lines if COMMAND not in line)
    at = lines.index(next(line for line in lines if "the standard" in line))
    sentence = " ".join(line[17:] for line in lines[at : at + 9] if line[:17].strip() in TITLES)
    assert sentence.startswith(" ".join(KNOWN["FRM-3"].sentence.split()))
    marked = [line[5:].strip() for line in lines if line.startswith("    >")]
    assert "".join(marked).replace(" ", "") == told.replace(" ", "")
    assert "\x1b[1;31m    >" in text(outs[1])


TITLES = ("", "the standard")


def test_what_to_start_with_comes_last_but_for_the_verdict() -> None:
    out = console(120)
    results = [failed("CHN-9"), failed("FRM-2", RULE, Level.PASSIVE)]
    print_what_next(out, results, ["The two ports may be swapped."], recorded=False)
    said = text(out)
    assert said.index("swapped") < said.index("Start with FRM-2") < said.index("--record FOLDER")
    assert "--select CHN-9 --record" in said, "a rule cannot be played again by itself"


def test_colour_is_for_terminals_that_want_it() -> None:
    refusing = {"TERM": "xterm", "NO_COLOR": "1"}
    outs = console(), console(**TERMINAL), console(**TERMINAL | {"_environ": refusing})
    for out in outs:
        print_end(out, "conforming at L1", "8 cases", 0)
    assert ["32m" in text(out) for out in outs] == [False, True, False]


def test_names_of_checks_read_as_words() -> None:
    assert words("check_unity_s_row_of_1_1_in_64_bits") == "unity's row of 1.1 in 64 bits"
