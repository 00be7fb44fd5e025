"""The order in which to look at failures, and when it is honest to say that others follow."""

from dataclasses import replace

from splatbus_conformance.reports.triage import in_order, start_with
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import Level, Result, Verdict


def sent(requirement: str, verdict: Verdict = Verdict.FAIL) -> Result:
    return Result(requirement, RULE, Level.PASSIVE, verdict)


def done(requirement: str, verdict: Verdict = Verdict.FAIL) -> Result:
    return Result(requirement, "check_something", Level.WIRE, verdict)


def test_what_it_sends_comes_first_and_packets_before_messages_before_connections() -> None:
    results = [
        done("CHN-20", Verdict.WARN),
        done("FRM-3"),
        sent("POS-2"),
        sent("JSN-6"),
        done("NEG-8", Verdict.PASS),
        sent("FRM-2"),
        done("CNV-1"),
    ]
    names = [it.requirement for it in in_order(results)]
    assert names == ["FRM-2", "JSN-6", "POS-2", "CNV-1", "FRM-3", "CHN-20"], (
        "below it what may follow"
    )


def test_others_follow_from_broken_packets() -> None:
    said = start_with([done("CHN-9"), done("INI-13"), sent("FRM-2")])
    assert said.startswith("Start with FRM-2: what cannot be cut into packets is not understood")
    assert "2 other failures may follow" in said


def test_what_could_not_be_observed_may_follow_too() -> None:
    skips = [done(f"NEG-{number}", Verdict.SKIP) for number in range(5)]
    assert "could not be observed" in start_with([*skips, sent("FRM-2")])
    seen = [done(f"CHN-{number}", Verdict.PASS) for number in range(5)]
    assert start_with([*skips, *seen, sent("FRM-2")]) == "", "as much was seen as was not"


def test_nothing_follows_from_how_hostile_input_is_taken_or_from_one_failure_alone() -> None:
    assert start_with([done("FRM-3"), done("CHN-9")]) == ""
    assert start_with([sent("FRM-2")]) == ""
    assert start_with([sent("POS-2"), sent("POS-3")]) == ""
    assert start_with([sent("FRM-7", Verdict.WARN), done("CHN-9")]) == ""


def test_what_is_done_to_the_memory_comes_before_what_follows_from_it() -> None:
    removed = replace(done("OPN-10"), code="removed-memory")
    results = [done("JSN-6"), sent("FRM-2"), done("IMG-13"), removed]
    assert in_order(results)[0] is removed
    assert start_with(results) == (
        "Start with OPN-10: memory that it has removed is not there for anybody; 3 other failures"
        " may follow from it."
    )
    assert start_with([removed]) == ""


def test_what_one_parser_takes_wrongly_is_one_thing_to_mend() -> None:
    read = [done(name) for name in ("JSN-10", "JSN-6", "JSN-8", "IMG-24")]
    assert start_with(read) == (
        "Start with JSN-6: one parser reads what JSN-6, JSN-8, JSN-10 ask about."
    )
