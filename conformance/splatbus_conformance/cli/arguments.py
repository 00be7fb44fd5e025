"""The command line of a live run as values: a plan, and what is wanted of the run besides."""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path

from splatbus_schemas.requirements import requirements
from splatbus_schemas.visible import worded

from splatbus_conformance.cli.options import FORMATS
from splatbus_conformance.plan import Plan, Side, Usage
from splatbus_conformance.reports import expected_failures
from splatbus_conformance.reports.expected_failures import Expectation, ExpectationsError
from splatbus_conformance.reports.files import Files, require_folder, require_writable
from splatbus_conformance.reports.thresholds import Thresholds
from splatbus_conformance.run.options import RunOptions, selectable_on, usual_patience, usual_ports
from splatbus_conformance.selection import ALL, Selection, UnknownTermError, terms
from splatbus_conformance.verdicts import Level

MOST_PORT = 65535
_IDS = re.compile(r"([A-Z]{3})-(\d+)(?: to \1-(\d+))?")


def plan_of(side: Side, arguments: argparse.Namespace) -> Plan:
    """Which testee to judge, and how. Raises Usage where that cannot be."""
    adapter = arguments.adapter if side == "client" else None
    starts_it = bool(arguments.launch or adapter)
    plan = Plan(
        side,
        arguments.launch,
        arguments.host,
        parse_ports(arguments.ports, usual_ports(starts_it)),
        arguments.viewport if side == "client" else (0, 0),
        arguments.patience or usual_patience(side, starts_it),
        profile=arguments.profile,
        seed=arguments.seed,
        selection=parse_selection(arguments.select, arguments.deselect, side),
        allow_crash=arguments.allow_crash,
        adapter=adapter,
        parallel=arguments.parallel,
        within=arguments.within,
        exitfirst=arguments.exitfirst,
        record=arguments.record,
        stand_in_cuda=arguments.stand_in_cuda,
    )
    if plan.stand_in_cuda and not starts_it:
        raise Usage(
            "--stand-in-cuda: the harness can replace libcudart only in a program that it starts: "
            "use --launch" + (" or --adapter" if side == "client" else "")
        )
    if plan.within and plan.profile == "soak":
        raise Usage("--within does not go with --profile soak, whose length is --minutes")
    if plan.parallel > 1 and not (starts_it and plan.ports == (0, 0)):
        raise Usage(
            f"--parallel {plan.parallel}: each testee needs its own ports, which the harness gives "
            "to the programs that it starts: use --launch or --adapter, and leave out --ports"
        )
    return plan


def wishes_of(side: Side, arguments: argparse.Namespace) -> RunOptions:
    """What is wanted of the run besides. Raises Usage where that cannot be."""
    partial = arguments.select or arguments.deselect
    if arguments.write_expected and partial:
        raise Usage(
            "--write-expected needs a whole run, or its list would lack failures: leave out "
            "--select and --deselect"
        )
    wishes = RunOptions(
        arguments.strict,
        Thresholds(
            Level(arguments.require_level),
            parse_share(arguments.require_coverage),
            arguments.require_version,
        ),
        _expectations(arguments.expect_failures, side),
        arguments.minutes,
        arguments.shrink,
        Path(arguments.scripts),
        Path(arguments.write_expected) if arguments.write_expected else None,
        files_of(arguments),
    )
    require_folder("--scripts", wishes.scripts)
    if wishes.write_expected:
        require_writable("--write-expected", wishes.write_expected)
    return wishes


def files_of(arguments: argparse.Namespace) -> Files:
    """Where reports go. Raises Usage for what cannot be written."""
    given = {name: getattr(arguments, name, None) for name in FORMATS}
    files = Files(**{name: Path(path) for name, path in given.items() if path is not None})
    files.require_writable()
    return files


def _expectations(name: str | None, side: Side) -> tuple[Expectation, ...]:
    if name is None:
        return ()
    try:
        return expected_failures.load(Path(name), selectable_on(side))
    except FileNotFoundError:
        made = f"--write-expected {name} makes it, in a run without --select"
        raise Usage(f"--expect-failures {name}: there is no such file; {made}") from None
    except (ExpectationsError, OSError) as error:
        raise Usage(f"--expect-failures: {worded(error)}") from None


def parse_ports(text: str | None, default: tuple[int, int]) -> tuple[int, int]:
    """`IPC,MSG` as two numbers."""
    if text is None:
        return default
    try:
        ipc, msg = (int(part) for part in text.split(","))
    except ValueError:
        raise Usage(f"--ports {text}: give two numbers, such as 6001,6000") from None
    if not (0 <= ipc <= MOST_PORT and 0 <= msg <= MOST_PORT):
        raise Usage(f"--ports {text}: a port is a number from 0 (any free port) to {MOST_PORT}")
    if ipc == msg != 0:
        raise Usage(f"--ports {text}: IPC and message need a port each, such as 6001,6000")
    return ipc, msg


def parse_share(text: str) -> float:
    """`90%` as 0.9."""
    number = text.removesuffix("%")
    if not (number.isdecimal() and int(number) <= 100):
        raise Usage(f"--require-coverage {text}: give a whole number of percent, such as 90%")
    return int(number) / 100


def _judged_by(side: Side) -> Mapping[str, tuple[str, ...]]:
    """For each requirement that binds the other side alone, those that say what this side is to do
    where it is broken.
    """
    known = requirements("1.1")
    found: dict[str, tuple[str, ...]] = {}
    for id, requirement in known.items():
        for clause, first, last in _IDS.findall(requirement.sentence):
            for number in range(int(first), int(last or first) + 1):
                other = f"{clause}-{number}"
                others = other in known and side not in known[other].binds
                if others and side in requirement.binds:
                    found[other.lower()] = (*found.get(other.lower(), ()), id)
    return found


def parse_selection(only: str, never: str, side: Side) -> Selection:
    """`--select` and `--deselect`; Usage for a term that means nothing."""
    if not (only or never):
        return ALL
    items = selectable_on(side)
    found = []
    for option, text in (("--select", only), ("--deselect", never)):
        try:
            found.append(terms(text, items, _judged_by(side)))
        except UnknownTermError as error:
            raise Usage(
                f"{option}: {error}; `splatbus-conformance list --peer {side}` shows all"
            ) from None
    return Selection(*found)
