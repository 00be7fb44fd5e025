"""A failure is delivered again: smaller, to new testees, and with the same outcome."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_conformance.cases.script import Case, Script, ScriptError
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.replay import replay, worked_out
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.trials.trial import Violation
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import broken

SEGMENTS = Script(
    *("client", "FRM-4", "check_any_segmentation", False),
    ((Case(False, 0), Case(True, [[5], 0.0, True])), ()),
)
ENDS_ON_AN_ESCAPE = (
    (
        "        value = json.loads(payload.decode()",
        "        if any(b'\\\\u00%d' % n in payload for n in range(2, 7)):  # of what needs none\n"
        "            os.closerange(3, 1024)\n"
        "            time.sleep(0.1)  # a process ends later than its sockets\n"
        "            os._exit(1)\n"
        "        value = json.loads(payload.decode()",
    ),
)
BEGINS_WITH_A_MARK = (("payload = json", "payload = b'\\xef\\xbb\\xbf' + json"),)
LATE_POSES = (("over.wait(0.03)", "over.wait(0.4)"), ('"w": 1.0}', '"w": 2.0}'))


@pytest.fixture
def testbed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Testbed]:
    """A testbed for the miniature, with the replacements of the test made in it."""
    command = broken(tmp_path, *getattr(request, "param", ()))
    testbed = set_up(Plan("client", command, "127.0.0.1", (0, 0), (64, 48), 10.0))
    testbed.introduce()
    yield testbed
    testbed.close()


@pytest.mark.parametrize("testbed", [ENDS_ON_AN_ESCAPE], indirect=True)
def test_a_failure_is_made_small_and_confirmed(testbed: Testbed) -> None:
    (check,) = (it for it in checks_of("client") if it.name == "check_takes_any_spelling")
    trial = testbed.trial(requirements("1.1")[check.requirement])
    with pytest.raises(Violation) as caught:
        check.play(trial)
    cases = tuple(map(tuple, trial.went_through))
    whole = Script("client", check.requirement, check.name, False, cases, seen=str(caught.value))
    small = worked_out(testbed, whole, 15.0)
    assert small.again == small.tried > 2
    (((_, (_, liberties)),),) = small.cases
    assert liberties == ["escapes"]
    assert "exited" in small.seen
    assert small.transcript
    assert replay(testbed, small).broken


def test_what_a_good_client_does_is_no_failure_and_no_other_cases_are_delivered(
    testbed: Testbed,
) -> None:
    given = replay(testbed, SEGMENTS)
    assert given.broken is None
    assert given.trial.went_through == [list(row) for row in SEGMENTS.cases]
    assert worked_out(testbed, SEGMENTS, 10.0) == replace(SEGMENTS, tried=3)
    with pytest.raises(ScriptError, match="check_of_old"):
        replay(testbed, replace(SEGMENTS, check="check_of_old"))


@pytest.mark.parametrize(
    ("testbed", "requirement", "check", "told", "marked"),
    [
        (BEGINS_WITH_A_MARK, "JSN-2", "check_keeps_the_ipc_connection", "byte-order mark", "hello"),
        (
            *(LATE_POSES, "POS-3", "check_host_and_ports_can_be_set"),
            *("norm of rotation", "/rotation, from byte"),
        ),
    ],
    indirect=["testbed"],
)
def test_a_breach_that_a_rule_finds_is_waited_for_and_shown(
    testbed: Testbed, requirement: str, check: str, told: str, marked: str
) -> None:
    given = replay(testbed, Script("client", requirement, check, True, ()))
    assert told in str(given.broken)
    assert marked in " ".join(line for line in given.transcript if line.startswith(">"))
