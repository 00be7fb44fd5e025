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
from splatbus_conformance.coverage import check_functions
from splatbus_conformance.judging import judge
from splatbus_conformance.plan import Plan, Side, Usage
from splatbus_conformance.reports import json_report
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
    starts_it = arguments.launch or arguments.adapter
    try:
        plan = Plan(
            "client",
            arguments.launch,
            arguments.host,
            parse_ports(arguments.ports, (0, 0) if starts_it else DEPLOYED_PORTS),
            parse_size(arguments.viewport),
            arguments.patience or (LAUNCH_PATIENCE if starts_it else WAIT_PATIENCE),
            arguments.profile,
            arguments.seed,
            parse_select(arguments.select, "client"),
            allow_crash=arguments.allow_crash,
            adapter=arguments.adapter,
        )
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    return judge(plan, arguments, out)


def server(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a server."""
    try:
        plan = Plan(
            "server",
            arguments.launch,
            arguments.host,
            parse_ports(arguments.ports, (0, 0) if arguments.launch else DEPLOYED_PORTS),
            (0, 0),
            arguments.patience or LAUNCH_PATIENCE,
            arguments.profile,
            arguments.seed,
            parse_select(arguments.select, "server"),
            allow_crash=arguments.allow_crash,
        )
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    return judge(plan, arguments, out)


def demo(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference client."""
    from splatbus_conformance.cli import parser

    command = f'"{sys.executable}" -m splatbus_client view'
    out.print(
        "Judging the reference client, as you would judge yours:\n"
        '  splatbus-conformance client --launch "splatbus-client view"\n'
    )
    return client(parser().parse_args(["client", "--launch", command]), out)


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
                    delivered=0,
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


def parse_select(text: str, side: Side) -> tuple[str, ...]:
    """`ID,…` as requirements that have a check; Usage for another."""
    names = tuple(name.strip().upper() for name in text.split(",") if name.strip())
    known = {function.check.requirement for function in check_functions(side)}
    if unknown := [name for name in names if name not in known]:
        raise Usage(
            f"--select {','.join(unknown)}: no check judges that; "
            f"`splatbus-conformance list --peer {side}` shows what is judged"
        )
    return names
