"""What is wanted of a live run, and the options that say so where they are not as usual."""

from dataclasses import dataclass
from pathlib import Path

from splatbus_conformance.checks.registry import checks_of, judges
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.reports.expected_failures import Expectation
from splatbus_conformance.reports.files import Files
from splatbus_conformance.reports.thresholds import Thresholds
from splatbus_conformance.run.checker import selectable
from splatbus_conformance.selection import RULE, Item
from splatbus_conformance.wire.secrets import hidden

USUAL_HOST = "127.0.0.1"
USUAL_SIZE = (64, 48)
DEPLOYED_PORTS = (6001, 6000)
LAUNCH_PATIENCE = 10.0
WAIT_PATIENCE = 120.0


@dataclass(frozen=True)
class RunOptions:
    """What makes a run a failure, and what is to be written of it."""

    strict: bool = False
    demands: Thresholds = Thresholds()  # noqa: RUF009 - it is frozen
    expectations: tuple[Expectation, ...] = ()
    minutes: float = 10.0
    """How long a soak goes on."""
    shrink_seconds: float = 0.0
    """For making failures small."""
    scripts: Path = Path("splatbus-failures")
    """Where a script of each failure goes."""
    write_expected: Path | None = None
    files: Files = Files()  # noqa: RUF009 - it is frozen


def usual_ports(starts_it: bool) -> tuple[int, int]:
    """Free ones for a testee that the harness starts, those of deployed programs otherwise."""
    return (0, 0) if starts_it else DEPLOYED_PORTS


def usual_patience(side: Side, starts_it: bool) -> float:
    """Seconds; somebody who has to start a client needs more."""
    return WAIT_PATIENCE if side == "client" and not starts_it else LAUNCH_PATIENCE


def as_options(plan: Plan) -> list[str]:
    """The options with which another command meets the same testee: of what a plan says of that,
    all that is not as usual.
    """
    how = ["--wait" if plan.side == "client" else "--connect"]
    if plan.starts_it:
        how = ["--adapter", plan.adapter] if plan.adapter else ["--launch", str(plan.launch)]
        how = [hidden(each) for each in how]
    told = (
        ("--host", plan.host, USUAL_HOST, plan.host),
        ("--ports", plan.ports, usual_ports(plan.starts_it), "{},{}".format(*plan.ports)),
        (
            "--viewport",
            plan.viewport,
            USUAL_SIZE if plan.side == "client" else (0, 0),
            "{}x{}".format(*plan.viewport),
        ),
        (
            "--patience",
            plan.patience,
            usual_patience(plan.side, plan.starts_it),
            f"{plan.patience:.15g}",
        ),
    )
    for option, value, usual, text in told:
        if value != usual:
            how += [option, text]
    return how + ["--stand-in-cuda"] * plan.stand_in_cuda


def selectable_on(side: Side) -> list[Item]:
    """All that can be selected: the checks of this side, and the requirements that rules judge."""
    rules = [
        Item(name, RULE, "L0")
        for name, found in judges(side).items()
        if any(judge.level == "L0" for judge in found)
    ]
    return rules + [selectable(it) for it in checks_of(side)]
