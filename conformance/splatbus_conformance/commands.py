"""What each command of `splatbus-conformance` does."""

import argparse
import json
import sys
import time
from pathlib import Path

from rich.console import Console
from splatbus_schemas.requirements import requirements

from splatbus_conformance import recording
from splatbus_conformance.audit import audit as judge_recording
from splatbus_conformance.audit import results as audit_results
from splatbus_conformance.browse import PEERS, print_explanation, print_list
from splatbus_conformance.coverage import check_functions, judges
from splatbus_conformance.findings import Traffic
from splatbus_conformance.judging import judge
from splatbus_conformance.plan import Plan, Side, Usage
from splatbus_conformance.plugin import selectable
from splatbus_conformance.reports import json_report
from splatbus_conformance.selection import RULE, Item, Selection, UnknownTermError, terms
from splatbus_conformance.terminal import print_connections, print_failures, summary
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    EXIT_USAGE,
    exit_code,
)

DEPLOYED_PORTS = (6001, 6000)
PLAIN_WIDTH = 240
DEMO_TESTEES = 6
"""More than cores: most of the time a check waits."""
LAUNCH_PATIENCE = 10.0
WAIT_PATIENCE = 120.0


def console(plain: bool) -> Console:
    """Where people read."""
    out = Console(highlight=False, no_color=plain or None, force_terminal=False if plain else None)
    if not out.is_terminal:
        out.width = PLAIN_WIDTH
    return out


def client(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a client."""
    return _live("client", arguments, out)


def server(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a server."""
    return _live("server", arguments, out)


def _live(side: Side, arguments: argparse.Namespace, out: Console) -> int:
    try:
        plan = plan_of(side, arguments)
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    return judge(plan, arguments, out)


def plan_of(side: Side, arguments: argparse.Namespace) -> Plan:
    """What the command line asks for. Raises Usage where that cannot be."""
    adapter = arguments.adapter if side == "client" else None
    starts_it = bool(arguments.launch or adapter)
    waits = side == "client" and not starts_it
    plan = Plan(
        side,
        arguments.launch,
        arguments.host,
        parse_ports(arguments.ports, (0, 0) if starts_it else DEPLOYED_PORTS),
        parse_size(arguments.viewport) if side == "client" else (0, 0),
        arguments.patience or (WAIT_PATIENCE if waits else LAUNCH_PATIENCE),
        profile=arguments.profile,
        seed=arguments.seed,
        selection=parse_selection(arguments.select, arguments.deselect, side),
        allow_crash=arguments.allow_crash,
        adapter=adapter,
        parallel=arguments.parallel,
        record=arguments.record,
        stand_in_cuda=side == "client" and arguments.stand_in_cuda,
    )
    if plan.stand_in_cuda and not starts_it:
        raise Usage(
            "--stand-in-cuda changes where the client finds libcudart, which the harness can do "
            "only for what it starts: use --launch or --adapter"
        )
    if plan.parallel > 1 and not (starts_it and plan.ports == (0, 0)):
        raise Usage(
            f"--parallel {plan.parallel}: several testees at a time need ports of their own, which "
            "the harness passes to what it starts: use --launch or --adapter, and leave out --ports"
        )
    return plan


def demo(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference client."""
    from splatbus_conformance.cli import parser

    command = f'"{sys.executable}" -m splatbus_client view'
    out.print(
        "Judging the reference client, as you would judge yours:\n"
        '  splatbus-conformance client --launch "splatbus-client view"\n'
    )
    line = ["client", "--launch", command, "--parallel", str(DEMO_TESTEES)]
    return client(parser().parse_args(line), out)


def audit(arguments: argparse.Namespace, out: Console) -> int:
    """Judge recorded sessions."""
    peers = PEERS if arguments.peer == "both" else (arguments.peer,)
    codes, reports = [], []
    for name in arguments.files:
        began = time.monotonic()
        try:
            judged = judge_recording(recording.load(Path(name)))
        except (OSError, recording.RecordingError, UnicodeDecodeError) as error:
            out.print(f"splatbus-conformance: {name}: {error}", markup=False)
            return EXIT_USAGE
        print_connections(out, name, judged)
        for peer in peers:
            results = audit_results(judged, peer)
            print_failures(out, results, requirements("1.1"))
            exercised = {f.requirement.id: f.requirement for f in judged.of(peer)}
            sentence, verdicts = summary(results, exercised, "L0")
            codes.append(exit_code(verdicts, strict=arguments.strict))
            out.print(f"{peer}: {sentence}", markup=False)
            reports.append(
                json_report(
                    f"the {peer} in {Path(name).name}",
                    sentence,
                    results,
                    exercised,
                    exit_code=codes[-1],
                    traffic=Traffic(),
                    seconds=time.monotonic() - began,
                )
            )
        out.print()
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(reports, indent=1) + "\n", "utf-8")
    if EXIT_NOT_CONFORMING in codes:
        return EXIT_NOT_CONFORMING
    return EXIT_CONFORMING if EXIT_CONFORMING in codes else EXIT_NO_VERDICT


def list_(arguments: argparse.Namespace, out: Console) -> int:
    """List requirements."""
    print_list(out, (arguments.peer,) if arguments.peer else PEERS)
    return EXIT_CONFORMING


def explain(arguments: argparse.Namespace, out: Console) -> int:
    """Explain requirements."""
    found = [print_explanation(out, name) for name in arguments.ids]
    return EXIT_CONFORMING if all(found) else EXIT_USAGE


def selftest(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the harness."""
    from splatbus_conformance.selftest.command import selftest as judge_the_harness

    return judge_the_harness(arguments, out)


def parse_ports(text: str | None, default: tuple[int, int]) -> tuple[int, int]:
    """`IPC,MSG` as two numbers."""
    if text is None:
        return default
    try:
        ipc, msg = (int(part) for part in text.split(","))
    except ValueError:
        raise Usage(f"--ports {text}: two numbers are wanted, such as 6001,6000") from None
    return ipc, msg


def parse_size(text: str) -> tuple[int, int]:
    """`WxH` as two numbers."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise Usage(f"--viewport {text}: width and height are wanted, such as 1920x1080") from None
    return width, height


def parse_selection(only: str, never: str, side: Side) -> Selection:
    """`--select` and `--deselect`; Usage for a term that means nothing."""
    items = selectable_on(side)
    found = []
    for option, text in (("--select", only), ("--deselect", never)):
        try:
            found.append(terms(text, items))
        except UnknownTermError as error:
            raise Usage(
                f"{option}: {error}; `splatbus-conformance list --peer {side}` shows all"
            ) from None
    return Selection(*found)


def selectable_on(side: Side) -> list[Item]:
    """All that can be selected: the checks of this side, and the requirements that rules judge."""
    rules = [
        Item(name, RULE, "L0")
        for name, found in judges(side).items()
        if any(judge.level == "L0" for judge in found)
    ]
    return rules + [selectable(it.__name__, it.check) for it in check_functions(side)]
