"""The order in which to look at failures, and when it is honest to say that others follow."""

from dataclasses import replace

import pytest
from splatbus_conformance.reports.triage import in_order, start_with
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import Level, Result, Verdict


def sent(requirement: str, verdict: Verdict = Verdict.FAIL) -> Result:
    return Result(requirement, RULE, Level.PASSIVE, verdict)


def done(requirement: str, verdict: Verdict = Verdict.FAIL) -> Result:
    return Result(requirement, "check_something", Level.WIRE, verdict)


REMOVED = replace(done("OPN-10"), code="removed-memory")
SKIPS = [done(f"NEG-{number}", Verdict.SKIP) for number in range(5)]
SEEN = [done(f"CHN-{number}", Verdict.PASS) for number in range(5)]


def test_what_it_sends_comes_first_and_packets_before_messages_before_connections() -> None:
    results = [
        *(done("CHN-20", Verdict.WARN), done("FRM-3"), sent("POS-2"), sent("JSN-6")),
        *(done("NEG-8", Verdict.PASS), sent("FRM-2"), done("CNV-1")),
    ]
    names = [it.requirement for it in in_order(results)]
    below = ["JSN-6", "POS-2", "CNV-1"]
    assert names == ["FRM-2", *below, "FRM-3", "CHN-20"], "below it what may follow"
    assert in_order([*results, REMOVED])[0] is REMOVED


@pytest.mark.parametrize(
    ("results", "told"),
    [
        (
            [done("CHN-9"), done("INI-13"), sent("FRM-2")],
            "Start with FRM-2: without whole packets nothing is understood;"
            " 2 other failures may follow from it.",
        ),
        (
            [*SKIPS, sent("FRM-2")],
            "Start with FRM-2: without whole packets nothing is understood;"
            " it may be why most requirements could not be observed.",
        ),
        ([*SKIPS, *SEEN, sent("FRM-2")], ""),
        ([done("FRM-3"), done("CHN-9")], ""),
        ([sent("FRM-2")], ""),
        ([sent("POS-2"), sent("POS-3")], ""),
        ([sent("FRM-7", Verdict.WARN), done("CHN-9")], ""),
        (
            [done("JSN-6"), REMOVED],
            "Start with OPN-10: it removed the memory, so nobody can open it any more;"
            " 1 other failure may follow from it.",
        ),
        ([REMOVED], ""),
        (
            [done(name) for name in ("JSN-10", "JSN-6", "JSN-8", "IMG-24")],
            "Start with JSN-6: JSN-6, JSN-8, JSN-10 are all about the same parser.",
        ),
        (
            [replace(done(name), code="exits") for name in ("JSN-10", "JSN-6", "JSN-8", "CHN-9")],
            "Start with JSN-10: in 4 failures its process ends; it has to run until the harness"
            " ends it.",
        ),
    ],
    ids=str,
)
def test_others_may_follow_from_what_it_sends_and_what_it_does_to_the_memory(
    results: list[Result], told: str
) -> None:
    assert start_with(results) == told
