"""A whole run on a live testee: meet it, judge it, say what came of it."""

import argparse
import json
import time
from pathlib import Path

from rich.console import Console
from splatbus_schemas.requirements import requirements

from splatbus_conformance import recording
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.plugin import Run, of_run
from splatbus_conformance.reports import json_report, junit_report
from splatbus_conformance.running import Interrupted, run_checks
from splatbus_conformance.stand import Stand, set_up
from splatbus_conformance.terminal import Live, print_failures, print_what_next, summary
from splatbus_conformance.verdicts import (
    EXIT_INTERRUPTED,
    EXIT_NO_VERDICT,
    EXIT_USAGE,
    Result,
    exit_code,
)


def judge(plan: Plan, arguments: argparse.Namespace, out: Console) -> int:
    """Judge a testee by a plan, and write the reports that the arguments ask for."""
    try:
        stand = set_up(plan)
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    live = Live(out)
    began = time.monotonic()
    run = Run(plan, stand, live)
    try:
        if not plan.starts_it:
            out.print(_what_to_start(stand, plan), markup=False)
        stand.introduce()
        run.recordings.append(list(stand.peer.entries))
        results = run_checks(run)
    except NoVerdict as error:
        out.print(f"no verdict: {error}", markup=False)
        return EXIT_NO_VERDICT
    except OSError as error:
        out.print(f"no verdict: cannot start the testee: {error}", markup=False)
        return EXIT_NO_VERDICT
    except Interrupted:
        return EXIT_INTERRUPTED
    finally:
        live.end()
        stand.close()
    return _report(run, results, time.monotonic() - began, arguments, out)


def _what_to_start(stand: Stand, plan: Plan) -> str:
    peer = stand.peer
    where = f"IPC {peer.host}:{peer.ports['ipc']}, message {peer.host}:{peer.ports['msg']}"
    if plan.side == "server":
        return f"Looking for a server at {where}."
    return f"Waiting for a client on {where}: start yours now (in an engine: press Play)."


def _report(
    run: Run,
    results: list[Result],
    seconds: float,
    arguments: argparse.Namespace,
    out: Console,
) -> int:
    judged, name = of_run(run), run.stand.testee.name
    print_failures(out, results, requirements("1.1"))
    print_what_next(out, results, recorded=bool(arguments.record))
    sentence, verdicts = summary(results, judged, "L2" if run.plan.adapter else "L1")
    status = exit_code(verdicts, strict=arguments.strict)
    out.print(f"{sentence}\n{run.delivered} cases delivered in {seconds:.1f} s")
    if arguments.json:
        report = json_report(
            name,
            sentence,
            results,
            judged,
            exit_code=status,
            delivered=run.delivered,
            seconds=seconds,
        )
        Path(arguments.json).write_text(json.dumps(report, indent=1) + "\n", "utf-8")
    if arguments.junit:
        Path(arguments.junit).write_bytes(junit_report(name, results, seconds))
    if arguments.record:
        folder = Path(arguments.record)
        folder.mkdir(parents=True, exist_ok=True)
        for number, entries in enumerate(run.recordings, 1):
            recording.save(entries, folder / f"{number:03}.jsonl")
    return status
