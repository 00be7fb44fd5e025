"""The command `splatbus-conformance`."""

import argparse
import math
import os
import signal
import sys
import traceback
from collections.abc import Sequence

from splatbus_conformance import commands
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.verdicts import EXIT_INTERRUPTED, EXIT_NO_VERDICT, EXIT_USAGE, Level

SHRINK_SECONDS = 30.0

EPILOG = """\
examples:
  splatbus-conformance demo
      judge the reference client, to see what a verdict looks like
  splatbus-conformance client --launch "./my-viewer --headless"
      start my-viewer again and again, and judge it
  splatbus-conformance client --launch ./my-viewer --parallel 4 --profile full
      deliver many more cases, to four of them at a time
  splatbus-conformance client --launch ./my-viewer --select FRM,JSN-6 --record sessions
      only the clause FRM and one requirement, and keep what crosses the wire
  splatbus-conformance client --launch ./my-viewer --write-expected known.toml
      note what is broken today; with --expect-failures known.toml only what changes fails
  splatbus-conformance client --wait --ports 6001,6000
      wait for a client that you start by hand, or inside an engine
  splatbus-conformance server --launch "./my-renderer"
      start my-renderer, and judge it as a server
  splatbus-conformance audit session.jsonl
      judge a recorded session, both sides of it
  splatbus-conformance proxy --to 127.0.0.1:6001,6000
      stand between a client and a server, and judge both while they talk
  splatbus-conformance explain FRM-3
      the sentence, what it accepts, and how it is checked

exit status: 0 conforming, 1 not conforming, 2 usage, 3 no verdict, 130 interrupted
"""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = argparse.ArgumentParser(
        prog="splatbus-conformance",
        description="Judge a SplatBus client or server: which requirements it meets, which it "
        "breaks, and the bytes that show it.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--plain", action="store_true", help="no colour, no moving lines")
    commands_ = top.add_subparsers(dest="command", required=True, metavar="COMMAND")

    client = commands_.add_parser(
        "client",
        help="judge a client",
        description="Judge a client. The harness plays the server, on two ports that it passes in "
        "SPLATBUS_HOST, SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT to what it launches.",
    )
    how = client.add_mutually_exclusive_group(required=True)
    how.add_argument("--launch", metavar="CMD", help="start this command, and judge it")
    how.add_argument(
        "--adapter",
        metavar="CMD",
        help="start this adapter, and judge the client beside it (conformance/ADAPTER.md)",
    )
    how.add_argument("--wait", action="store_true", help="wait for a client that you start")
    client.add_argument(
        "--viewport",
        metavar="WxH",
        default="64x48",
        help="image size to announce (%(default)s); some clients insist on their own",
    )
    _live_options(
        client,
        ports="ports to listen on (free ones, 6001,6000 with --wait)",
        host="address to listen on",
    )
    client.set_defaults(run=commands.client)

    server = commands_.add_parser(
        "server",
        help="judge a server",
        description="Judge a server. The harness plays its clients. A server that it launches has "
        "to listen on the ports that it finds in SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT. If it "
        "requires a token, the harness takes that from SPLATBUS_TOKEN.",
    )
    how = server.add_mutually_exclusive_group(required=True)
    how.add_argument("--launch", metavar="CMD", help="start this command, and judge it")
    how.add_argument("--connect", action="store_true", help="judge a server that runs already")
    _live_options(
        server,
        ports="ports of the server (free ones with --launch, 6001,6000 with --connect)",
        host="address of the server",
    )
    server.set_defaults(run=commands.server)

    replay = commands_.add_parser(
        "replay",
        help="show a failure again",
        usage="%(prog)s FILE (--launch CMD | --adapter CMD | --wait | --connect) …",
        description="Deliver the script that a run wrote of a failure, and say whether the testee "
        "fails again. What follows FILE are options of `client`, or of `server`.",
    )
    replay.add_argument("file", metavar="FILE")
    replay.add_argument("how", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    replay.set_defaults(run=commands.replay)

    audit = commands_.add_parser(
        "audit",
        help="judge a recorded session",
        description="Judge recorded sessions by what both sides sent. The format of a recording "
        "is in conformance/RECORDING.md.",
    )
    audit.add_argument("files", nargs="+", metavar="FILE")
    _audit_options(audit)
    audit.set_defaults(run=commands.audit)

    proxy = commands_.add_parser(
        "proxy",
        help="record and judge a live session of a client and a server",
        description="Stand between a real client and a real server: pass on what they say, show "
        "it as it goes, write it down, and judge both at the end. Start the server, start this, "
        "and have the client connect to the ports of --listen. Handles of memory pass through, so "
        "images go their usual way.",
    )
    proxy.add_argument(
        "--listen",
        metavar="HOST:IPC,MSG",
        default="127.0.0.1:7001,7000",
        help="where the client connects to (%(default)s)",
    )
    proxy.add_argument(
        "--to",
        metavar="HOST:IPC,MSG",
        default="127.0.0.1:6001,6000",
        help="where the server listens (%(default)s)",
    )
    proxy.add_argument(
        "--record",
        metavar="FILE",
        default="splatbus-session.jsonl",
        help="what passes, for `audit` (%(default)s)",
    )
    proxy.add_argument(
        "--seconds", type=float, metavar="S", default=math.inf, help="end by itself after so long"
    )
    _audit_options(proxy)
    proxy.set_defaults(run=commands.proxy)

    demo = commands_.add_parser("demo", help="judge the reference client")
    demo.set_defaults(run=commands.demo)

    list_ = commands_.add_parser("list", help="every requirement, and how it is checked")
    list_.add_argument("--peer", choices=("client", "server"), help="only those that bind this one")
    list_.set_defaults(run=commands.list_)

    explain = commands_.add_parser("explain", help="one requirement: sentence, reason, check")
    explain.add_argument("ids", nargs="+", metavar="ID")
    explain.set_defaults(run=commands.explain)

    selftest = commands_.add_parser(
        "selftest",
        help="judge the harness: the reference must pass, each mutant must die",
        description="Run the reference client and server, which must pass, and a zoo of mutants "
        "of them, each of which breaks one requirement and must fail for it.",
    )
    selftest.add_argument("--only", metavar="NAME,…", default="", help="only these mutants")
    selftest.add_argument("--json", metavar="FILE", help="write the kill matrix")
    selftest.add_argument(
        "--profile",
        choices=("brief", "quick"),
        default="brief",
        help="for variations: all checks, with fewer cases or with all (%(default)s)",
    )
    selftest.add_argument(
        "--seeds",
        type=int,
        metavar="N",
        default=0,
        help="only the references, with N seeds, which must not change a verdict",
    )
    selftest.set_defaults(run=commands.selftest)
    return top


def _audit_options(command: argparse.ArgumentParser) -> None:
    """What is asked of a judgement by bytes alone."""
    command.add_argument("--peer", choices=("client", "server", "both"), default="both")
    command.add_argument("--strict", action="store_true", help="a warning fails the run")
    command.add_argument("--json", metavar="FILE", help="write a report for programs")


def _live_options(command: argparse.ArgumentParser, *, ports: str, host: str) -> None:
    """The options that both kinds of testee have, by the question that they answer."""
    where = command.add_argument_group("where the testee is")
    where.add_argument("--host", default="127.0.0.1", help=f"{host} (%(default)s)")
    where.add_argument("--ports", metavar="IPC,MSG", help=ports)
    where.add_argument(
        "--stand-in-cuda",
        action="store_true",
        help="give it a CUDA runtime without a GPU, and judge what it does with device memory "
        "(conformance/STAND_IN_CUDA.md)",
    )
    where.add_argument(
        "--patience", type=float, metavar="S", help="longest wait for a connection, in seconds"
    )
    where.add_argument(
        "--parallel",
        type=at_least_one,
        metavar="N",
        default=1,
        help="start N testees, each on ports of its own, and share the checks out (%(default)s)",
    )

    what = command.add_argument_group("what it is judged by")
    what.add_argument(
        "--profile",
        choices=("brief", "quick", "full", "soak"),
        default="quick",
        help="how many cases: a quarter of quick, a thousand, ten thousand, or full ones with new "
        "seeds for --minutes (%(default)s)",
    )
    what.add_argument(
        "--minutes", type=float, metavar="N", default=10.0, help="length of a soak (%(default)g)"
    )
    what.add_argument("--seed", type=int, default=0, help="for the drawn cases (%(default)s)")
    what.add_argument(
        "--select",
        metavar="TERM,…",
        default="",
        help="only these: ids (FRM-3), clauses (FRM), levels (L0 to L3), checks (check_…)",
    )
    what.add_argument(
        "--deselect", metavar="TERM,…", default="", help="not these; wins over --select"
    )
    what.add_argument(
        "--allow-crash",
        action="store_true",
        help="without --launch: also run what may crash a testee that breaks a requirement",
    )

    failing = command.add_argument_group("what fails the run besides a broken MUST")
    failing.add_argument("--strict", action="store_true", help="a warning")
    failing.add_argument(
        "--require-coverage",
        metavar="N%",
        default="0%",
        help="less than N%% of the MUSTs on this testee observed (%(default)s)",
    )
    failing.add_argument(
        "--require-level",
        choices=tuple(Level),
        default=Level.PASSIVE,
        help="nothing observed at this assurance; what is seen at less does not count (L0)",
    )
    failing.add_argument(
        "--expect-failures",
        metavar="FILE",
        help="a listed failure that passes or is another now; one that is as listed fails nothing",
    )

    reports = command.add_argument_group("what is written")
    reports.add_argument("--json", metavar="FILE", help="a report for programs")
    reports.add_argument("--junit", metavar="FILE", help="a report for CI systems")
    reports.add_argument("--record", metavar="FOLDER", help="all that crosses the wire")
    reports.add_argument(
        "--write-expected",
        metavar="FILE",
        help="the list for --expect-failures that fits this run; it takes a whole one",
    )
    reports.add_argument(
        "--shrink",
        type=float,
        metavar="S",
        default=SHRINK_SECONDS,
        help="seconds, in all, to make failures small in (%(default)g); 0 leaves them as they are",
    )
    reports.add_argument(
        "--scripts",
        metavar="FOLDER",
        default="splatbus-failures",
        help="a script of each failure, for `replay` (%(default)s)",
    )


def at_least_one(text: str) -> int:
    """A number of testees. Raises ValueError."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} testees are none: 1 or more are wanted")
    return number


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit status."""
    arguments = parser().parse_args(argv)
    # Whoever starts this in the background of a shell passes on that SIGINT is ignored.
    for ending in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ending, signal.default_int_handler)
    out = commands.console(arguments.plain)
    try:
        return int(arguments.run(arguments, out))
    except Usage as error:
        out.print(f"splatbus-conformance: {error}", markup=False)
        return EXIT_USAGE
    except NoVerdict as error:
        out.print(f"no verdict: {error}", markup=False)
        return EXIT_NO_VERDICT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_INTERRUPTED
    except Exception:
        traceback.print_exc()
        print("no verdict: the harness failed; the fault is its own", file=sys.stderr)
        return EXIT_NO_VERDICT
