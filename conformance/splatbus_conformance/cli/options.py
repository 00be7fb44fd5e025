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
    "badge": "what the endpoint badge of shields.io reads",
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
        help="whom to judge (%(default)s)",
    )
    command.add_argument("--strict", action="store_true", help="a warning fails the run")
    format_options(command.add_argument_group("what is written"))


def live_options(command: argparse.ArgumentParser, *, ports: str, host: str) -> None:
    """What is asked of a live run on either kind of testee, by the question that it answers."""
    where = command.add_argument_group("where the testee is")
    where.add_argument("--host", default=USUAL_HOST, help=f"{host} (%(default)s)")
    where.add_argument("--ports", metavar="IPC,MSG", help=ports)
    where.add_argument(
        "--stand-in-cuda",
        action="store_true",
        help="give it a CUDA runtime without a GPU, and judge what it does with device memory "
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
        help="start N testees, each on ports of its own, and share the checks out; without it, as "
        "many as machine and testee allow, and 1 for one after the other",
    )

    what = command.add_argument_group("what it is judged by")
    what.add_argument(
        "--profile",
        choices=PROFILES,
        default="quick",
        help="how many cases: a quarter of quick, a thousand, ten thousand, or full ones with new "
        "seeds for --minutes (%(default)s)",
    )
    what.add_argument(
        "--minutes", type=POSITIVE, metavar="N", default=10.0, help="length of a soak (%(default)g)"
    )
    what.add_argument("--seed", type=WHOLE, default=0, help="for the drawn cases (%(default)s)")
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

    what.add_argument(
        "--within",
        type=option(_time, "time such as 90s, 5m or 1h"),
        metavar="T",
        default=0.0,
        help="a time that the run has to keep to, such as 90s or 5m: what matters most comes "
        "first, and what did not run is counted",
    )
    what.add_argument(
        "--exitfirst", action="store_true", help="with --parallel 1: end it once a MUST is broken"
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
        "--require-version",
        choices=VERSIONS,
        default=VERSIONS[0],
        help="a testee that speaks an older one (%(default)s)",
    )
    failing.add_argument(
        "--expect-failures",
        metavar="FILE",
        help="a listed failure that passes or is another now; one that is as listed fails nothing",
    )

    written = command.add_argument_group("what is written")
    format_options(written)
    written.add_argument("--record", metavar="FOLDER", help="all that crosses the wire")
    written.add_argument(
        "--write-expected",
        metavar="FILE",
        help="the list for --expect-failures that fits this run; it takes a whole one",
    )
    written.add_argument(
        "--shrink",
        type=option(within(float, 0), "number from 0 on, such as 10"),
        metavar="S",
        default=SHRINK_SECONDS,
        help="seconds, in all, to deliver failures again and make them small in (%(default)g)",
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
