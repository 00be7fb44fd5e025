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
from splatbus_conformance.host_memory import HostMemory, sweep
from splatbus_conformance.introduction import NothingConnects, introduce
from splatbus_conformance.messages import ring_bytes
from splatbus_conformance.peer import CHANNELS, Peer
from splatbus_conformance.plugin import Run, of_run
from splatbus_conformance.recording import Channel
from splatbus_conformance.reports import json_report, junit_report
from splatbus_conformance.role import Role
from splatbus_conformance.running import Interrupted, run_checks
from splatbus_conformance.terminal import (
    Live,
    print_connections,
    print_failures,
    print_what_next,
    summary,
)
from splatbus_conformance.testee import Awaited, Launched
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    EXIT_USAGE,
    exit_code,
)

DEPLOYED_PORTS = (6001, 6000)
SLOTS = 3
PLAIN_WIDTH = 240
LAUNCH_PATIENCE = 10.0
WAIT_PATIENCE = 120.0


class Usage(Exception):  # noqa: N818 - a finding, no error of ours
    """The command line cannot be carried out; the message says why and what to do."""


def console(plain: bool) -> Console:
    """Where people read."""
    out = Console(highlight=False, no_color=plain or None, force_terminal=False if plain else None)
    if not out.is_terminal:
        out.width = PLAIN_WIDTH
    return out


def client(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a client."""
    try:
        ports = parse_ports(arguments.ports, launching=bool(arguments.launch))
        width, height = parse_size(arguments.viewport)
        select = parse_select(arguments.select)
        peer = listening_peer(arguments.host, ports)
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    environment = {
        "SPLATBUS_HOST": arguments.host,
        "SPLATBUS_IPC_PORT": str(peer.ports["ipc"]),
        "SPLATBUS_MSG_PORT": str(peer.ports["msg"]),
    }
    testee = Launched(arguments.launch, environment) if arguments.launch else Awaited()
    patience = arguments.patience or (LAUNCH_PATIENCE if arguments.launch else WAIT_PATIENCE)
    sweep()
    memory = HostMemory(ring_bytes(width, height, SLOTS))
    role = Role(memory, width, height, SLOTS)
    live = Live(out)
    began = time.monotonic()
    try:
        if arguments.wait:
            where = f"IPC {peer.host}:{peer.ports['ipc']}, message {peer.host}:{peer.ports['msg']}"
            out.print(
                f"Waiting for a client on {where}: start yours now (in an engine: press Play)."
            )
        facts = introduce(peer, role, testee, patience)
        run = Run(peer, role, testee, facts, patience, live)
        run.recordings.append(list(peer.entries))
        run.profile, run.seed = arguments.profile, arguments.seed
        run.allow_crash = arguments.allow_crash
        run.select = select
        results = run_checks(run)
    except NothingConnects as error:
        out.print(f"no verdict: {error}", markup=False)
        return EXIT_NO_VERDICT
    except OSError as error:
        out.print(f"no verdict: cannot start the testee: {error}", markup=False)
        return EXIT_NO_VERDICT
    except Interrupted:
        return EXIT_INTERRUPTED
    finally:
        live.end()
        testee.close()
        peer.close()
        memory.close()
    judged = of_run(run)
    print_failures(out, results, requirements("1.1"))
    print_what_next(out, results, recorded=bool(arguments.record))
    sentence, verdicts = summary(results, judged, "L1")
    status = exit_code(verdicts, strict=arguments.strict)
    seconds = time.monotonic() - began
    out.print(f"{sentence}\n{run.delivered} cases delivered in {seconds:.1f} s")
    if arguments.json:
        report = json_report(
            testee.name,
            sentence,
            results,
            judged,
            exit_code=status,
            delivered=run.delivered,
            seconds=seconds,
        )
        Path(arguments.json).write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    if arguments.junit:
        Path(arguments.junit).write_bytes(junit_report(testee.name, results, seconds))
    if arguments.record:
        folder = Path(arguments.record)
        folder.mkdir(parents=True, exist_ok=True)
        for number, entries in enumerate(run.recordings, 1):
            recording.save(entries, folder / f"{number:03}.jsonl")
    return status


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


def parse_ports(text: str | None, *, launching: bool) -> dict[Channel, int]:
    """`IPC,MSG` as a mapping; free ports (0) for a testee that is launched and told of them."""
    if text is None:
        return dict(zip(CHANNELS, (0, 0) if launching else DEPLOYED_PORTS, strict=True))
    try:
        ipc, msg = (int(part) for part in text.split(","))
    except ValueError:
        raise Usage(f"--ports {text}: two numbers are wanted, such as 6001,6000") from None
    return {"ipc": ipc, "msg": msg}


def parse_size(text: str) -> tuple[int, int]:
    """`WxH` as two numbers."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise Usage(f"--viewport {text}: width and height are wanted, such as 1920x1080") from None
    return width, height


def parse_select(text: str) -> tuple[str, ...]:
    """`ID,…` as requirements that have a check; Usage for another."""
    names = tuple(name.strip().upper() for name in text.split(",") if name.strip())
    known = {function.check.requirement for function in check_functions()}
    if unknown := [name for name in names if name not in known]:
        raise Usage(
            f"--select {','.join(unknown)}: no check judges that; "
            "`splatbus-conformance list --peer client` shows what is judged"
        )
    return names


def listening_peer(host: str, ports: dict[Channel, int]) -> Peer:
    """A peer that listens on both channels; Usage if a port cannot be had."""
    peer = Peer(host, ports)
    for channel in CHANNELS:
        try:
            peer.listen(channel)
        except OSError as error:
            peer.close()
            raise Usage(
                f"cannot listen on {host}:{ports[channel]} for the {channel} channel "
                f"({error.strerror}); does another server run? --ports names other ports"
            ) from None
    return peer
