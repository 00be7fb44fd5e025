"""Run all that must pass: linters, types, import rules, the specification, the tests, the zoo.

`python -m tests` runs every step, `python -m tests lint types` those that are named;
`python -m tests zoo --only NAME` some of the zoo, `python -m tests renew` writes what is made of
something else, `python -m tests long` does what takes hours.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from pathlib import Path

if sys.version_info < (3, 11):  # noqa: UP036 - pip refuses these, but a checkout runs without it
    sys.exit(f"Python 3.11 or newer is needed, and this is {sys.version.split()[0]}")

from tests.keeper import Kept, end
from tests.progress import LATER, minutes

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("schemas", "reference_server", "reference_client", "conformance", "tests", "benchmarks")
RENDERERS = (
    "schemas/splatbus_schemas",
    "schemas/splatbus_wire",
    "reference_server/splatbus_server",
    "reference_server/splatbus_renderer",
    "reference_server/splatbus_splats",
    "reference_client/splatbus_client",
    "reference_client/splatbus_viewer",
)
"""What runs where trained models live, which is Python 3.9 and later."""
PACKAGES = (
    *RENDERERS,
    "reference_client/blender/splatbus_blender",
    "conformance/splatbus_conformance",
    "conformance/site/splatbus_site",
)
PYTHON = (sys.executable, "-m")
LACKING = (
    *("/usr/bin/env", "MYPYPATH=tests/stubs", *PYTHON, "mypy"),
    *("--no-warn-return-any", "--no-warn-unused-ignores", "--allow-untyped-decorators"),
)
"""Looks for what Python lacks on another system or in an old version. NumPy has no types there
(`tests/stubs`): that our calls fit them is for `types` to see, and takes most of its time.
"""
ELSEWHERE = (
    *(*LACKING, "--no-site-packages", "--ignore-missing-imports", "--allow-subclassing-any"),
    *("--disable-error-code", "var-annotated", "--disable-error-code", "misc"),
)
"""The same for a system on which this is not: no package of others has types."""
CORES = os.cpu_count() or 1
READ = {
    "lint": (*PYTHON, "ruff", "check", *SOURCES),
    "format": (*PYTHON, "ruff", "format", "--check", *SOURCES),
    "imports": (str(Path(sys.executable).with_name("lint-imports")),),
    "size": (*PYTHON, "tests.size"),
    "prose": (*PYTHON, "splatbus_schemas.prose"),
    "python3.9": (
        *(str(Path(sys.executable).with_name("vermin")), "--no-tips", "--eval-annotations"),
        *("--target=3.9-", "--violations", *RENDERERS),
    ),
    "types": (*PYTHON, "mypy", *PACKAGES),
    "win32": (
        *(*ELSEWHERE, "--platform", "win32", "--cache-dir", ".mypy_cache/win32"),
        *("--follow-imports", "silent", *PACKAGES),
    ),
    "darwin": (*ELSEWHERE, "--platform", "darwin", "--cache-dir", ".mypy_cache/darwin", *PACKAGES),
    "python3.10": (  # mypy's oldest
        *(*LACKING, "--python-version", "3.10", "--cache-dir", ".mypy_cache/3.10", *RENDERERS),
    ),
}
"""What reads the sources, on one core."""
RUN = {
    "tests": (*PYTHON, "pytest", "--quiet", "-p", "tests.dealer", "--deal", str(4 * CORES)),
    "zoo": (*PYTHON, "tests.zoo"),
}
"""What runs them, on all cores that are left."""
STEPS = READ | RUN


@dataclass(frozen=True)
class Running:
    """A step that runs."""

    name: str
    began: float
    printed: Path | None
    """Where what it prints is kept until it has ended, if it is."""


def main(wanted: list[str]) -> int:
    """Run the steps named, or all until one fails: those of both kinds beside each other."""
    if wanted in (["--help"], ["-h"]):
        print(__doc__)
        return 0
    zoo_in_part = wanted[:1] == ["zoo"] and any(it[:1] == "-" for it in wanted)
    if wanted[:1] in (["long"], ["renew"]) or zoo_in_part:
        return subprocess.run((*PYTHON, f"tests.{wanted[0]}", *wanted[1:]), cwd=ROOT).returncode
    if unknown := set(wanted) - set(STEPS):
        print(f"no such step: {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")
        return 2
    with tempfile.TemporaryDirectory(prefix="splatbus-steps-") as folder:
        lanes = [[name for name in lane if name in (wanted or STEPS)] for lane in (READ, RUN)]
        status = run(lanes, Path(folder), renews=not wanted)
    if not wanted and not status:
        subprocess.run((*PYTHON, "tests.long", "--behind"), cwd=ROOT)
    return status


def run(lanes: list[list[str]], folder: Path, *, renews: bool) -> int:
    """Run the steps of each lane one after the other; the status of the first that fails, or 0.

    A run of all `renews` how long each took, and ends with the first that fails.
    """
    from tests.durations import Durations  # which takes what may not be installed

    durations = Durations("steps")
    environment = caching(dict(os.environ), folder / "bytecode")
    silent = len(lanes[1]) > 0
    running: dict[Kept, Running] = {}
    table: list[str] = []
    status = 0

    def begin(lane: list[str]) -> None:
        name = lane.pop(0)
        later = str(sum(durations.of(it) for it in lane)) if name in RUN else "0"
        printed = folder / name if silent and name in READ else None
        print(f"== {name}" + (" (beside the others)" if printed else ""), flush=True)
        work = partial(become, STEPS[name], environment | {LATER: later}, printed)
        running[Kept(work)] = Running(name, time.monotonic(), printed)

    try:
        for lane in filter(None, lanes):
            begin(lane)
        while running and not (renews and status):
            ended = wait([kept.fate for kept in running])
            for kept in [it for it in running if it.fate in ended]:
                step, fate = running.pop(kept), kept.fate.recv()
                end(kept)
                seconds = time.monotonic() - step.began
                failed = fate.status or fate.left
                if step.printed and failed:
                    print(step.printed.read_text("utf-8", "replace"), flush=True)
                if fate.left:
                    print(f"== {step.name} left processes behind: {'; '.join(fate.left)}")
                told = f"{step.name:<11}{minutes(seconds):>6}{fate.cpu_seconds:>8.0f} s"
                print(f"== {step.name} {'failed' if failed else 'passed'}", flush=True)
                table.append(told)
                durations.took(step.name, seconds)
                status = status or fate.status or bool(fate.left)
                lane = lanes[step.name in RUN]
                if lane and not (renews and status):
                    begin(lane)
    finally:
        end(*running)
    print("== step     minutes  processor", *table, sep="\n   ", flush=True)
    if renews and not status:
        durations.save()
    return status


def become(
    command: tuple[str, ...], environment: Mapping[str, str], printed: Path | None, _: Connection
) -> None:
    """In the process of a step."""
    os.chdir(ROOT)
    if printed:
        for stream in (1, 2):
            os.dup2(os.open(printed, os.O_WRONLY | os.O_CREAT | os.O_APPEND), stream)
    os.execve(command[0], command, environment)


def caching(environment: dict[str, str], folder: Path) -> dict[str, str]:
    """An environment whose many processes do not all compile the same modules.

    Where Python is told to write no bytecode, none is written here, but into this folder.
    """
    if environment.pop("PYTHONDONTWRITEBYTECODE", ""):
        environment["PYTHONPYCACHEPREFIX"] = str(folder)
    return environment


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
