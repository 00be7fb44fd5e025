"""Options that several commands have, each declared once."""

import argparse
import re

from splatbus_schemas import VERSIONS
from splatbus_schemas.options import COUNT, POSITIVE, WHOLE, option, within

from splatbus_conformance.run.options import USUAL_HOST
from splatbus_conformance.selection import PROFILES
from splatbus_conformance.verdicts import Level

SHRINK_SECONDS = 30.0
_TIME = re.compile(r"(\d+(?:\.\d+)?)([smh])")
FORMATS = {
    "json": "a report for programs, from which `report` makes the others",
    "junit": "a report for CI systems, as JUnit XML",
    "html": "a page for people",
    "markdown": "a summary for a CI step; it is appended to FILE",
    "badge": "JSON for the endpoint badge of shields.io",
}


def format_options(group: argparse._ActionsContainer, *names: str) -> None:
    """Where reports go; of all formats, or of those that are named."""
    for name in names or FORMATS:
        group.add_argument(f"--{name}", metavar="FILE", help=FORMATS[name])


def recording_options(command: argparse.ArgumentParser) -> None:
    """What is asked of a judgement by bytes alone."""
    command.add_argument(
        "--peer",
        choices=("client", "server", "both"),
        default="both",
        help="which side to judge (%(default)s)",
    )
    command.add_argument("--strict", action="store_true", help="a warning fails the run")
    format_options(command.add_argument_group("what is written"))


def live_options(command: argparse.ArgumentParser, *, ports: str, host: str) -> None:
    """What is asked of a live run on either kind of testee, by the question that it answers."""
    where = command.add_argument_group("where the testee (your program) is")
    where.add_argument("--host", default=USUAL_HOST, help=f"{host} (%(default)s)")
    where.add_argument("--ports", metavar="IPC,MSG", help=ports)
    where.add_argument(
        "--stand-in-cuda",
        action="store_true",
        help="give it a stand-in for the CUDA runtime, and judge what it does with device memory "
        "(conformance/STAND_IN_CUDA.md)",
    )
    where.add_argument(
        "--patience", type=POSITIVE, metavar="S", help="longest wait for a connection, in seconds"
    )
    where.add_argument(
        "--parallel",
        type=COUNT,
        metavar="N",
        default=0,
        help="start N testees at once, each on its own ports, and share the checks out (as many "
        "as machine and testee allow)",
    )

    what = command.add_argument_group("how it is judged")
    what.add_argument(
        "--profile",
        choices=PROFILES,
        default="quick",
        help="how many cases: quick has about a thousand, brief fewer, full more; soak repeats "
        "full with new seeds for --minutes (%(default)s)",
    )
    what.add_argument(
        "--minutes", type=POSITIVE, metavar="N", default=10.0, help="length of a soak (%(default)g)"
    )
    what.add_argument(
        "--seed", type=WHOLE, default=0, help="another one draws other cases (%(default)s)"
    )
    what.add_argument(
        "--select",
        metavar="TERM,…",
        default="",
        help="run only these: ids (FRM-3), clauses (FRM), levels (L0 to L3), checks (check_…)",
    )
    what.add_argument(
        "--deselect", metavar="TERM,…", default="", help="leave these out, also of --select"
    )
    what.add_argument(
        "--allow-crash",
        action="store_true",
        help="without --launch: also run cases that could crash a faulty testee",
    )

    what.add_argument(
        "--within",
        type=option(_time, "time such as 90s, 5m or 1h"),
        metavar="T",
        default=0.0,
        help="end the run within this time, such as 90s or 5m: what matters most runs first, and "
        "what did not run is counted",
    )
    what.add_argument(
        "--exitfirst", action="store_true", help="with --parallel 1: stop at the first broken MUST"
    )

    failing = command.add_argument_group("when the run fails, besides a broken MUST")
    failing.add_argument("--strict", action="store_true", help="if there is a warning")
    failing.add_argument(
        "--require-coverage",
        metavar="N%",
        default="0%",
        help="if less than N%% of the MUSTs on this testee were observed (%(default)s)",
    )
    failing.add_argument(
        "--require-level",
        choices=tuple(Level),
        default=Level.PASSIVE,
        help="if nothing was observed at this level; lower levels do not count then (L0)",
    )
    failing.add_argument(
        "--require-version",
        choices=VERSIONS,
        default=VERSIONS[0],
        help="if the testee speaks only an older version (%(default)s)",
    )
    failing.add_argument(
        "--expect-failures",
        metavar="FILE",
        help="if a listed failure passes or changes; as listed, it does not fail the run",
    )

    written = command.add_argument_group("what is written")
    format_options(written)
    written.add_argument(
        "--record", metavar="FOLDER", help="recordings of all that crosses the wire"
    )
    written.add_argument(
        "--write-expected",
        metavar="FILE",
        help="a list of the failures, for --expect-failures; needs a whole run",
    )
    written.add_argument(
        "--shrink",
        type=option(within(float, 0), "number from 0 on, such as 10"),
        metavar="S",
        default=SHRINK_SECONDS,
        help="seconds in all to deliver failures again and shrink them (%(default)g)",
    )
    written.add_argument(
        "--scripts",
        metavar="FOLDER",
        default="splatbus-failures",
        help="a script of each failure, for `replay` (%(default)s)",
    )


def _words(text: str) -> str:
    if not text.strip():
        raise ValueError
    return text


def _time(text: str) -> float:
    told = _TIME.fullmatch(text)
    if told is None or not float(told[1]):
        raise ValueError
    return float(told[1]) * {"s": 1.0, "m": 60.0, "h": 3600.0}[told[2]]


COMMAND = option(_words, "command, such as ./my-viewer")
