"""`splatbus-conformance selftest`: the judge is tried on a client that is broken on purpose.

Each row changes a line of the client that comes with the harness, which conforms as it is.
"""

import argparse
import multiprocessing
import os
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.text import Text

import splatbus_conformance
from splatbus_conformance.plan import NoVerdict, Plan
from splatbus_conformance.reports.console import CleanConsole
from splatbus_conformance.reports.terminal import LiveProgress
from splatbus_conformance.run.options import LAUNCH_PATIENCE, USUAL_HOST, USUAL_SIZE
from splatbus_conformance.run.running import run_checks
from splatbus_conformance.run.workers import FORKS
from splatbus_conformance.selection import Selection
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING, Verdict

CLIENT = Path(splatbus_conformance.__file__).with_name("minimal_client.py")
TRAFFIC = "CHN-10"
"""Its check makes what the rules judge."""
AT_A_TIME = 3 * (os.cpu_count() or 1)
"""Most of the time a check waits."""
AS_IT_IS = "as it is"
TWICE = "return position, [2 * n for n in rotation]"
HELLO = "connection.sendall(packet(hello([])))"
ASKS = 'connection.sendall(packet({"type": "get_viewport_size"}))'
OPENED = 'connection.sendall(packet({"type": "opened", "generation": generation}))'
RELEASED = 'connection.sendall(packet({"type": "release"} | lease))'


class Row(NamedTuple):
    """A fault, and the requirement that it breaks."""

    requirement: str
    does: str
    line: str
    instead: str


ROWS = (
    Row("FRM-3", "waits for any length", "if not 1 <= length <= MAX_PAYLOAD:", "if False:"),
    Row("JSN-8", "accepts a duplicate name", "hook=once", "hook=dict"),
    Row("POS-1", "leaves w out of rotations", '"xyzw", rotation, strict=True', '"xyz", rotation'),
    Row("POS-3", "sends rotations twice as long", "return position, rotation", TWICE),
    Row("POS-8", "says the time in words", '"timestamp": now', '"timestamp": "noon"'),
    Row("POS-9", "has a clock that runs backwards", '"timestamp": now', '"timestamp": -now'),
    Row("NEG-1", "says something before hello", HELLO, f"{ASKS}; {HELLO}"),
    Row("NEG-2", "says no version in hello", '"versions": VERSIONS, ', ""),
    Row("REQ-2", "leaves out which camera it asks for", ', "cam_idx": 0', ""),
    Row("IMG-12", "releases each frame twice", RELEASED, f"{RELEASED}; {RELEASED}"),
    Row("OPN-1", "says opened twice", OPENED, f"{OPENED}; {OPENED}"),
    Row("REQ-12", "asks for the size again at once", "now + 0.2 if", "now if"),
)


def selftest(_: argparse.Namespace, out: Console) -> int:
    """Judge the client as it is, and each that is broken; 1 unless all comes as it must."""
    good = 0
    context: Any = multiprocessing.get_context("fork" if FORKS else "spawn")
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(AT_A_TIME, context) as pool:
        found = pool.map(partial(judged, Path(folder)), (None, *ROWS))
        for row, told in zip((None, *ROWS), found, strict=True):
            wanted = row.requirement if row else ""
            right = list(told) == [wanted] * bool(row)
            good += right
            line = Text(f"  {wanted or 'conforms':<9}", "green" if right else "bold red")
            line.append(f"{row.does if row else AS_IT_IS}: ")
            line.append(", ".join(f"{name} {it}" for name, it in told.items()) or "nothing broken")
            out.print(line)
    out.print(f"{good} of {len(ROWS) + 1} are judged correctly")
    return EXIT_CONFORMING if good == len(ROWS) + 1 else EXIT_NOT_CONFORMING


def judged(folder: Path, row: Row | None) -> dict[str, str]:
    """What the harness says of a client that is broken so: the requirements that are not met."""
    source = CLIENT.read_text("utf-8")
    if row:
        assert source.count(row.line) == 1, f"{row.line} does not stand once in {CLIENT.name}"
        source = source.replace(row.line, row.instead)
    program = folder / f"{row.requirement if row else 'good'}.py"
    program.write_text(source, "utf-8")
    selection = Selection(
        (TRAFFIC, *([row.requirement] if row else [it.requirement for it in ROWS]))
    )
    launch = f'"{sys.executable}" "{program}"'
    plan = Plan(
        *("client", launch, USUAL_HOST, (0, 0), USUAL_SIZE, LAUNCH_PATIENCE),
        profile="brief",
        selection=selection,
    )
    try:
        results = run_checks(plan, LiveProgress(CleanConsole(quiet=True))).results(plan)
    except NoVerdict as error:
        return {"no verdict": str(error)}
    bad = (Verdict.FAIL, Verdict.WARN, Verdict.ERROR)
    return {it.requirement: it.verdict for it in results if it.verdict in bad}
