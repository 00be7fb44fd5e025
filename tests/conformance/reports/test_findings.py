"""Findings: they cross from process to process, and those of several runs add up."""

import pickle
from dataclasses import replace

from splatbus_conformance.measurements import Measurement
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
FAILED = Result(
    "FRM-3",
    "check_a",
    Level.WIRE,
    Verdict.FAIL,
    "it said \ud800",
    ("line",),
    0.5,
    (Measurement("angle", float("inf"), 0.1, "rad", "case 3", 9, 1),),
)


def passed(place: int) -> Result:
    return Result("FRM-4", f"check_{place}", Level.WIRE, Verdict.PASS)


def test_a_result_crosses_to_another_process_with_whatever_a_testee_sent() -> None:
    assert pickle.loads(pickle.dumps(FAILED)) == FAILED


def test_traffic_crosses_too() -> None:
    traffic = Traffic("cmd", "1.1", "GPU-1", 3, 2, 0.5, 1.5, {"FRM-1": Count(4, 1, "\ud800")})
    traffic.latencies["ping → pong"] = Histogram({-40: 2}, 0.01)
    assert pickle.loads(pickle.dumps(traffic)) == traffic


def test_results_are_in_the_order_of_their_places_and_the_rules_come_last() -> None:
    findings = Findings(Traffic(version="1.1", tally={"FRM-1": Count(2, 0)}))
    for place in (3, 1, 2):
        findings.put(place, passed(place))
    assert [it.check for it in findings.results(PLAN)] == ["check_1", "check_2", "check_3", "rule"]


def test_rules_on_what_was_not_selected_say_nothing() -> None:
    findings = Findings(Traffic(version="1.1", tally={"FRM-1": Count(2, 0), "JSN-1": Count(1, 0)}))
    plan = replace(PLAN, selection=Selection(("FRM",), ()))
    assert [it.requirement for it in findings.results(plan)] == ["FRM-1"]


def test_of_several_seeds_the_failure_stays_and_says_which_it_was() -> None:
    findings = Findings()
    findings.add(Findings(placed={1: passed(1)}), 7)
    findings.add(Findings(placed={1: FAILED}), 8)
    findings.add(Findings(placed={1: passed(1)}), 9)
    assert findings.placed[1].verdict is Verdict.FAIL
    assert findings.placed[1].text.endswith("(seed 8)")


def test_the_breaches_that_rules_saw_say_the_seed_of_the_first() -> None:
    findings = Findings()
    for seed, count in (
        (7, Count(2, 0)),
        (8, Count(2, 1, Breach("too-long", "a"))),
        (9, Count(2, 2, Breach("too-long", "b"))),
    ):
        findings.add(Findings(Traffic(tally={"FRM-1": count})), seed)
    assert findings.traffic.tally["FRM-1"] == Count(6, 3, Breach("too-long", "a (seed 8)"))


def test_only_the_rules_that_are_wanted_judge_and_only_this_side() -> None:
    recorded = conversations(talk("msg", raw("c2s", b"\x00\x00\x00\x00more")))
    rules = rules_on({"FRM-2"})
    assert tally(recorded, "client", rules)["FRM-2"].broken == 1
    assert tally(recorded, "server", rules) == {}
    assert tally(recorded, "client", rules_on({"POS-1"})) == {}
