"""A failure is delivered again: smaller, to new testees, and with the same outcome."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from splatbus_conformance.cases.script import Case, Script, ScriptError, save
from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.replay import replay, worked_out
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.trials.trial import Violation
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import said

MINIATURE = Path(__file__).parents[1] / "miniatures" / "client.py"
SEGMENTS = "check_any_segmentation"


@pytest.fixture
def testbed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Testbed]:
    """A testbed for the miniature, with the replacements of the test made in it."""
    source = MINIATURE.read_text("utf-8")
    for old, new in getattr(request, "param", ()):
        assert old in source
        source = source.replace(old, new)
    path = tmp_path / "client.py"
    path.write_text(source, "utf-8")
    command = f'"{sys.executable}" "{path}" 1.1'
    plan = Plan("client", command, "127.0.0.1", (0, 0), (64, 48), 10.0)
    testbed = set_up(plan)
    testbed.introduce()
    yield testbed
    testbed.close()


def failing(testbed: Testbed, name: str) -> Script:
    """The script of a check that fails."""
    check = next(f for f in checks_of("client") if f.name == name)
    trial = testbed.trial(requirements("1.1")[check.requirement])
    with pytest.raises(Violation) as caught:
        check.play(trial)
    cases = tuple(map(tuple, trial.went_through))
    return Script("client", check.requirement, name, False, cases, seen=str(caught.value))


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


@pytest.mark.parametrize("testbed", [ENDS_ON_AN_ESCAPE], indirect=True)
def test_a_failure_is_made_small_and_confirmed(testbed: Testbed) -> None:
    whole = failing(testbed, "check_takes_any_spelling")
    small = worked_out(testbed, whole, 15.0)
    assert small.again == small.tried > 2
    (((_, (_, liberties)),),) = small.cases
    assert liberties == ["escapes"]
    assert "exited" in small.seen
    assert small.transcript
    assert replay(testbed, small).broken


def test_what_a_good_client_does_is_no_failure(testbed: Testbed) -> None:
    script = Script(
        "client", "FRM-4", SEGMENTS, False, ((Case(True, [[1, 2, 3], 0.0, False]),), ())
    )
    assert replay(testbed, script).broken is None
    again = worked_out(testbed, script, 10.0)
    assert again.again == 0
    assert again == replace(script, tried=3)


def test_only_the_cases_of_the_script_are_delivered(testbed: Testbed) -> None:
    script = Script(
        "client", "FRM-4", SEGMENTS, False, ((Case(False, 0), Case(True, [[5], 0.0, True])), ())
    )
    given = replay(testbed, script)
    assert given.trial.went_through == [[Case(False, 0), Case(True, [[5], 0.0, True])], []]


MARK = "b'\\xef\\xbb\\xbf' + "
BREAKS_A_RULE = (("payload = json", f"payload = {MARK}json"),)


@pytest.mark.parametrize("testbed", [BREAKS_A_RULE], indirect=True)
def test_a_breach_that_a_rule_finds_is_found_again(testbed: Testbed) -> None:
    script = Script("client", "JSN-2", "check_keeps_the_ipc_connection", True, ())
    assert "byte-order mark" in str(replay(testbed, script).broken)


LATE_POSES = (("over.wait(0.03)", "over.wait(0.4)"), ('"w": 1.0}', '"w": 2.0}'))


@pytest.mark.parametrize("testbed", [LATE_POSES], indirect=True)
def test_a_breach_that_comes_after_its_check_is_waited_for_and_shown(testbed: Testbed) -> None:
    given = replay(testbed, Script("client", "POS-3", "check_host_and_ports_can_be_set", True, ()))
    assert "norm of rotation" in str(given.broken)
    marked = [line for line in given.transcript if line.startswith(">")]
    assert "camera_pose" in marked[1]
    assert "/rotation, from byte" in marked[2]


def test_a_check_that_is_gone_is_named(testbed: Testbed) -> None:
    with pytest.raises(ScriptError, match="check_of_old"):
        replay(testbed, Script("client", "FRM-3", "check_of_old", False, ()))


def test_a_command_that_does_not_exist_is_no_verdict(tmp_path: Path) -> None:
    path = tmp_path / "script.json"
    save(Script("client", "FRM-4", SEGMENTS, False, ()), path)
    code, output = said("replay", str(path), "--launch", "/nowhere/my-viewer")
    assert code == 3
    assert "cannot start the testee" in output
    assert "Traceback" not in output
