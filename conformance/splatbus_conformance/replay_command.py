"""`splatbus-conformance replay`: deliver one script, and say whether it fails again."""

from dataclasses import replace

from rich.console import Console
from rich.markup import escape
from rich.text import Text
from splatbus_schemas.requirements import requirements

from splatbus_conformance.plan import Plan
from splatbus_conformance.replaying import Replay, replay
from splatbus_conformance.script import Script
from splatbus_conformance.stand import set_up
from splatbus_conformance.terminal import words
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
)


def replay_script(script: Script, plan: Plan, out: Console) -> int:
    """Deliver a script to the testee of a plan: 1 if it fails again, 0 if it does not, 3 if nothing
    can be said. Raises Usage, NoVerdict.
    """
    stand = set_up(replace(plan, side=script.side, viewport=script.viewport))
    try:
        stand.introduce()
        given = replay(stand, script)
    finally:
        stand.close()
    _print(script, given, out)
    if given.skipped:
        return EXIT_NO_VERDICT
    return EXIT_CONFORMING if given.broken is None else EXIT_NOT_CONFORMING


def _print(script: Script, given: Replay, out: Console) -> None:
    requirement = requirements("1.1")[script.requirement]
    style, verdict = ("green", "NOT AGAIN") if given.broken is None else ("bold red", "AGAIN")
    out.print(f"[{style}]{verdict}[/] [bold]{requirement.id}[/] [dim]{words(script.check)}[/]")
    out.print(f"  the standard   {escape(requirement.sentence)}")
    out.print(f"  acceptable     {', '.join(requirement.acceptable)}")
    out.print(f"  seen before    {escape(script.seen)}")
    out.print(f"  seen now       {escape(given.broken or 'nothing that breaks it')}")
    if given.skipped:
        out.print(f"  not judged     {escape(given.skipped)}")
    for line in given.transcript:
        out.print(Text(f"    {line}", "dim"), no_wrap=True, overflow="ellipsis")
