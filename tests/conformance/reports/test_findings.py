"""Findings: they cross from process to process, and those of several runs add up."""

import pickle
from dataclasses import replace

from splatbus_conformance.plan import Plan
from splatbus_conformance.reports.findings import Findings, Traffic
from splatbus_conformance.reports.latencies import Histogram
from splatbus_conformance.rules import Breach
from splatbus_conformance.rules.tally import Count, rules_on, tally
from splatbus_conformance.selection import Selection
from splatbus_conformance.verdicts import Level, Result, Verdict
from splatbus_conformance.wire.conversation import conversations

from tests.conformance.rules.talk import raw, talk

PLAN = Plan("client", "cmd", "127.0.0.1", (0, 0), (64, 48), 1.0)
FAILED = Result("FRM-3", "check_a", Level.WIRE, Verdict.FAIL, "it said \ud800", ("line",))


def passed(place: int) -> Result:
    return Result("FRM-4", f"check_{place}", Level.WIRE, Verdict.PASS)


def test_they_cross_to_another_process_with_whatever_a_testee_sent() -> None:
    traffic = Traffic("cmd", "1.1", "GPU-1", 3, 2, 0.5, 1.5, {"FRM-1": Count(4, 1, "\ud800")})
    traffic.latencies["ping → pong"] = Histogram({-40: 2}, 0.01)
    assert pickle.loads(pickle.dumps((FAILED, traffic))) == (FAILED, traffic)


def test_results_are_in_the_order_of_their_places_and_the_rules_that_are_wanted_come_last() -> None:
    findings = Findings(Traffic(version="1.1", tally={"FRM-1": Count(2, 0), "JSN-1": Count(1, 0)}))
    for place in (3, 1, 2):
        findings.put(place, passed(place))
    plan = replace(PLAN, selection=Selection(("FRM",), ()))
    found = [(it.check, it.requirement) for it in findings.results(plan)]
    assert found == [*((f"check_{n}", "FRM-4") for n in (1, 2, 3)), ("rule", "FRM-1")]


def test_who_is_not_what_it_was_after_a_check_has_not_passed_it() -> None:
    loss = Result("CHN-14", "check_1", Level.WIRE, Verdict.FAIL, "it is gone")
    findings = Findings(Traffic(losses=[loss]), {1: passed(1), 2: passed(2)})
    one, two, lost = findings.results(PLAN)
    assert (one.verdict, one.text) == (Verdict.SKIP, "it is gone (CHN-14)")
    assert (two, lost) == (passed(2), loss)


def test_of_several_seeds_the_failure_stays_and_says_which_it_was() -> None:
    findings = Findings()
    counts = [
        Count(2, 0),
        Count(2, 1, Breach("too-long", "a")),
        Count(2, 2, Breach("too-long", "b")),
    ]
    for seed, result, count in zip((7, 8, 9), (passed(1), FAILED, passed(1)), counts, strict=True):
        findings.add(Findings(Traffic(tally={"FRM-1": count}, delivered=seed), {1: result}), seed)
    assert findings.placed[1] == replace(FAILED, text=f"{FAILED.text} (seed 8)")
    assert findings.traffic.tally["FRM-1"] == Count(6, 3, Breach("too-long", "a (seed 8)"))
    assert (findings.traffic.delivered, findings.seeds) == (24, [7, 8, 9])
    assert findings.traffic.sentence(2.0).startswith("24 cases delivered in 2.0 s; each took 0.00")


def test_only_the_rules_that_are_wanted_judge_and_only_this_side() -> None:
    recorded = conversations(talk("msg", raw("c2s", b"\x00\x00\x00\x00more")))
    rules = rules_on({"FRM-2"})
    assert tally(recorded, "client", rules)["FRM-2"].broken == 1
    assert tally(recorded, "server", rules) == {}
    assert tally(recorded, "client", rules_on({"POS-1"})) == {}
