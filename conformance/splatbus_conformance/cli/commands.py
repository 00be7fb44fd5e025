"""What each command of `splatbus-conformance` does."""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from splatbus_schemas.visible import worded

from splatbus_conformance.cases.script import load
from splatbus_conformance.cli.arguments import files_of, parse_ports, plan_of, wishes_of
from splatbus_conformance.cli.compare import compare
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.cli.replay import replay_script
from splatbus_conformance.cli.requirements import PEERS, print_explanation, print_list
from splatbus_conformance.cli.selftest import selftest
from splatbus_conformance.data import read_text
from splatbus_conformance.observe.audit import audit as judge_recording
from splatbus_conformance.observe.audit import audit_capture
from splatbus_conformance.observe.judgement import opinion
from splatbus_conformance.plan import SIDES, Side, Usage
from splatbus_conformance.reports.files.stored import load as load_reports
from splatbus_conformance.run.judging import judge
from splatbus_conformance.run.options import DEPLOYED_PORTS
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_USAGE
from splatbus_conformance.wire import capture, recording

DEMO_TESTEES = 12
"""More than cores: most of the time a check waits."""


def client(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a client."""
    return _live("client", arguments, out)


def server(arguments: argparse.Namespace, out: Console) -> int:
    """Judge a server."""
    return _live("server", arguments, out)


def _live(side: Side, arguments: argparse.Namespace, out: Console) -> int:
    return judge(plan_of(side, arguments), wishes_of(side, arguments), out)


def replay(arguments: argparse.Namespace, out: Console) -> int:
    """Show a failure again, or play one side of a recording again."""
    if Path(arguments.file).suffix == ".jsonl":
        from splatbus_conformance.cli.play import play_recording, side_of

        side = side_of(arguments.how)
        given = parser().parse_args(arguments.how)
        plan, files = plan_of(side, given), files_of(given)
        return play_recording(Path(arguments.file), plan, files, out, strict=given.strict)
    try:
        script = load(Path(arguments.file))
    except OSError as error:
        raise Usage(worded(error)) from error
    given = parser().parse_args([script.side, *arguments.how])
    return replay_script(script, plan_of(script.side, given), files_of(given), out)


def demo(arguments: argparse.Namespace, out: Console) -> int:
    """Judge the reference client."""
    files = files_of(arguments)
    command = f'"{sys.executable}" -m splatbus_viewer view'
    out.print(
        "Judging the reference client, as you would judge yours:\n"
        '  splatbus-conformance client --launch "splatbus-client view"\n'
    )
    # NumPy starts twice as fast without threads that nothing here needs.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    line = ["client", "--launch", command, "--parallel", str(DEMO_TESTEES), "--patience", "60"]
    given = parser().parse_args(line)
    return judge(plan_of("client", given), replace(wishes_of("client", given), files=files), out)


def audit(arguments: argparse.Namespace, out: Console) -> int:
    """Judge recorded or captured sessions."""
    files, ports = files_of(arguments), parse_ports(arguments.ports, DEPLOYED_PORTS)
    judged = []
    for name in arguments.files:
        try:
            if capture.is_capture(Path(name)):
                judged.append((name, audit_capture(capture.load(Path(name), *ports))))
            else:
                judged.append((name, judge_recording(recording.read(Path(name)))))
        except recording.RecordingError as error:
            raise Usage(f"{name}: {error}") from error
        except (OSError, capture.CaptureError) as error:
            raise Usage(worded(error)) from error
    return opinion(judged, peers_of(arguments), files, out, strict=arguments.strict)


def proxy(arguments: argparse.Namespace, out: Console) -> int:
    """Stand between a client and a server, and judge both."""
    from splatbus_conformance.observe.proxy import endpoint, session

    files, file = files_of(arguments), Path(arguments.record)
    judged = session(
        endpoint(arguments.listen), endpoint(arguments.to), file, arguments.seconds, out
    )
    return opinion([(str(file), judged)], peers_of(arguments), files, out, strict=arguments.strict)


def peers_of(arguments: argparse.Namespace) -> tuple[Side, ...]:
    """Whom to judge of a session."""
    return SIDES if arguments.peer == "both" else (arguments.peer,)


def report(arguments: argparse.Namespace, out: Console) -> int:
    """Make reports of a stored one."""
    if arguments.schema:
        out.print(read_text("report.schema.json"), end="", soft_wrap=True)
        return EXIT_CONFORMING
    reports = load_reports(Path(arguments.file))
    files = files_of(arguments)
    if not any(files):
        raise Usage(f"{arguments.file}: say what to make from it, such as --html FILE")
    files.write(reports)
    for each in reports:
        out.print(f"{each['testee']}: {each['summary']}")
    return EXIT_CONFORMING


def list_(arguments: argparse.Namespace, out: Console) -> int:
    """List requirements."""
    print_list(out, (arguments.peer,) if arguments.peer else PEERS)
    return EXIT_CONFORMING


def explain(arguments: argparse.Namespace, out: Console) -> int:
    """Explain requirements."""
    found = [print_explanation(out, name) for name in arguments.ids]
    return EXIT_CONFORMING if all(found) else EXIT_USAGE


COMMANDS = {
    it.__name__.rstrip("_"): it
    for it in (
        client,
        server,
        replay,
        audit,
        proxy,
        report,
        compare,
        demo,
        selftest,
        list_,
        explain,
    )
}
