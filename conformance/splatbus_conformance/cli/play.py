"""`splatbus-conformance replay SESSION.jsonl`: play one side of a recording to the other."""

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from splatbus_schemas.visible import worded

from splatbus_conformance.observe.audit import Audit, AuditFinding, audit
from splatbus_conformance.observe.judgement import opinion
from splatbus_conformance.observe.playback import Played, play, steps
from splatbus_conformance.plan import SIDES, Plan, Side, Usage
from splatbus_conformance.reports.files import Files
from splatbus_conformance.reports.terminal import STYLE
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.verdicts import Verdict
from splatbus_conformance.wire.recording import RecordingError, load
from splatbus_conformance.wire.redaction import restored
from splatbus_conformance.wire.saving import save
from splatbus_conformance.wire.secrets import TOKEN_VARIABLE, own_token

SETTLE_SECONDS = 1.0
REST_SECONDS = 0.3
MOST_MISSED = 5
PEER: dict[Side, Side] = {"client": "server", "server": "client"}


def side_of(words: Sequence[str]) -> Side:
    """Whom a recording is to be played to: the first word. Raises Usage."""
    for side in SIDES:
        if words[:1] == [side]:
            return side
    raise Usage(
        "a recording has two sides: say which one to judge, as in "
        "`replay SESSION.jsonl client --launch CMD` or `replay SESSION.jsonl server --connect`"
    )


def play_recording(file: Path, plan: Plan, files: Files, out: Console, *, strict: bool) -> int:
    """Play what the testee's peer said in a recording to the testee of a plan, and judge by the
    rules what the testee says this time; the exit status. With a folder for recordings in the plan,
    that session is written there too.

    Raises Usage, NoVerdict.
    """
    try:
        recorded = load(file)
    except OSError as error:
        raise Usage(worded(error)) from error
    except RecordingError as error:
        raise Usage(f"{file}: {error}") from error
    whole, lacking = restored(recorded, own_token()) if plan.side == "server" else (recorded, 0)
    given = steps(whole, plan.side)
    if not given:
        raise Usage(f"{file}: the {PEER[plan.side]} sends nothing in it that could be played")
    if lacking:
        out.print(
            f"{lacking} `hello` have no token, since recordings leave it out; a server that "
            "requires one refuses them. Those that came in one piece have the token in "
            f"{TOKEN_VARIABLE}."
        )
    files.remove_former()
    testbed = set_up(plan)
    try:
        testbed.testee.ensure_running()
        played = play(given, testbed.peer, testbed.testee, plan.patience)
        testbed.peer.pump(SETTLE_SECONDS)
        testbed.testee.stop()
        testbed.peer.pump(REST_SECONDS)
        entries = list(testbed.peer.entries)
    finally:
        testbed.close()
    if plan.record:
        Path(plan.record).mkdir(parents=True, exist_ok=True)
        save(entries, Path(plan.record, file.name))
    judged = audit(entries)
    _print(plan.side, played, audit(recorded), judged, out)
    name = f"{file.name}, played again"
    return opinion([(name, judged)], (plan.side,), files, out, strict=strict)


def _print(side: Side, played: Played, then: Audit, now: Audit, out: Console) -> None:
    out.print(
        f"Played {played.delivered:,} of {played.steps:,} pieces of the recorded {PEER[side]}.",
    )
    for text in played.missed[:MOST_MISSED]:
        out.print(f"  not seen this time: {text}", style="dim")
    if more := played.missed[MOST_MISSED:]:
        out.print(f"  and {len(more)} more", style="dim")
    before, after = (_broken(it, side) for it in (then, now))
    for id, finding in (before | after).items():
        word = "AGAIN" if id in before and id in after else "NEW" if id in after else "NOT AGAIN"
        style = STYLE[Verdict.PASS if word == "NOT AGAIN" else finding.verdict]
        assert finding.first
        out.print(f"{word}  ", style=style, end="")
        out.print(f"{id}  {finding.first.text}", soft_wrap=True)
    if not before and not after:
        out.print(f"The {side} broke nothing then, and breaks nothing now.")
    out.print()


def _broken(judged: Audit, side: Side) -> dict[str, AuditFinding]:
    return {it.requirement.id: it for it in judged.of(side) if it.broken}
