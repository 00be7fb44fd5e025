"""What each command of `splatbus-conformance` does."""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from splatbus_schemas.requirements import requirements

from splatbus_conformance import recording
from splatbus_conformance.asking import plan_of, wishes_of
from splatbus_conformance.audit import Audit
from splatbus_conformance.audit import audit as judge_recording
from splatbus_conformance.audit import results as audit_results
from splatbus_conformance.browse import PEERS, print_explanation, print_list
from splatbus_conformance.findings import Traffic
from splatbus_conformance.judging import judge
from splatbus_conformance.plan import SIDES, Side, Usage
from splatbus_conformance.replay_command import replay_script
from splatbus_conformance.reports.as_json import json_report
from splatbus_conformance.script import load
from splatbus_conformance.terminal import print_connections, print_failures, summary
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NO_VERDICT,
    EXIT_NOT_CONFORMING,
    EXIT_USAGE,
    exit_code,
)

PLAIN_WIDTH = 240
DEMO_TESTEES = 6
"""More than cores: most of the time a check waits."""


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
    return judge(plan_of(side, arguments), wishes_of(side, arguments), out)


def replay(arguments: argparse.Namespace, out: Console) -> int:
    """Show a failure again."""
    from splatbus_conformance.cli import parser

    try:
        script = load(Path(arguments.file))
    except OSError as error:
        raise Usage(str(error)) from error
    plan = plan_of(script.side, parser().parse_args([script.side, *arguments.how]))
    return replay_script(script, plan, out)


def demo(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference client."""
    from splatbus_conformance.cli import parser

    command = f'"{sys.executable}" -m splatbus_client view'
    out.print(
        "Judging the reference client, as you would judge yours:\n"
        '  splatbus-conformance client --launch "splatbus-client view"\n'
    )
    # NumPy starts twice as fast without threads that nothing here needs.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    line = ["client", "--launch", command, "--parallel", str(DEMO_TESTEES)]
    return client(parser().parse_args(line), out)


def audit(arguments: argparse.Namespace, out: Console) -> int:
    """Judge recorded sessions."""
    judged = []
    for name in arguments.files:
        try:
            judged.append((name, judge_recording(recording.load(Path(name)))))
        except (OSError, recording.RecordingError, UnicodeDecodeError) as error:
            raise Usage(f"{name}: {error}") from error
    return _opinion(judged, arguments, out)


def proxy(arguments: argparse.Namespace, out: Console) -> int:
    """Stand between a client and a server, and judge both."""
    from splatbus_conformance.proxy import endpoint, relayed, watch

    listen, to, file = endpoint(arguments.listen), endpoint(arguments.to), Path(arguments.record)
    out.print(
        f"Clients connect to {listen}, and are passed on to {to}; recorded in {file}.\n"
        f"For a client that reads the environment: SPLATBUS_HOST={listen.host}"
        f" SPLATBUS_IPC_PORT={listen.ipc} SPLATBUS_MSG_PORT={listen.msg}",
        markup=False,
    )
    with relayed(listen, to, file):
        live = watch(out, file, f"{listen} → {to}", arguments.seconds)
    return _opinion([(str(file), live.judged())], arguments, out)


def _opinion(
    audits: Iterable[tuple[str, Audit]], arguments: argparse.Namespace, out: Console
) -> int:
    """Say what the audits found; the exit status."""
    peers = SIDES if arguments.peer == "both" else (arguments.peer,)
    codes, reports = [], []
    for name, judged in audits:
        began = time.monotonic()
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
                    peer,
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
