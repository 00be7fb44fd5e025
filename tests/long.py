"""`python -m tests long`: all that takes longer than a test may, in as many sittings as it takes.

Each foreign program and each client for an engine, in the profile full, some at a time; alone on
the machine, but for who only waits, the extension in each Blender, the C++ client's programs for
Windows under Wine, and the reference pair with three seeds; the pair once more beside two processes
that never rest. The seeds hang on the commit of the first sitting. What is done stays done until a
source changes.
"""

import argparse
import contextlib
import json
import math
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.blender import blenders
from tests.blender.blenders import BLENDERS, installed, passing
from tests.blender.running import adapter
from tests.engines.built import built
from tests.foreign import programs as foreign_programs
from tests.foreign.programs import Lacking, Program, differences, judge, programs

ROOT = Path(__file__).resolve().parents[1]
REPORT = "report.json"
RESULT = ROOT / "tests" / "results" / "long.json"
SOURCES = (
    *("conformance", "schemas", "reference_client", "reference_server"),
    *("tests/blender", "tests/engines", "tests/foreign", "tests/long.py"),
    *(f":(exclude){each}" for each in ("*.md", "*.png", "*.jpg", "*durations.json")),
)
"""A result is of these: what it judges, and by what."""
WINE = "tests/engines/under_wine.py"
ENGINES = {"csharp": ("unity",), "cpp": ("unreal", "opengl", "opengl device")}
"""The clients for engines, each in folders of its own, and the axes of their adapters."""
COMPILERS = {"csharp": ("mcs", "mono"), "cpp": ("g++",)}
PAIR_SEEDS = 3
AXES = ("opencv", "unity", "unreal", "blender", "opengl", "opengl_camera")
"""One by each seed."""
PAIR = {
    "client": ("client", "--launch", "splatbus_viewer view", {}),
    "client beside its adapter": ("client", "--adapter", "splatbus_viewer.adapter --axes {}", {}),
    "server": ("server", "--launch", "splatbus_renderer --quiet --size 64x48", {}),
    "server with a token": (
        *("server", "--launch", "splatbus_renderer --quiet --size 64x48"),
        {"SPLATBUS_TOKEN": "a token that both are given"},
    ),
}
GOOD = frozenset({"pass", "skip", "warn"})
AT_A_TIME = 3 * (os.cpu_count() or 1)
"""Of foreign programs, which mostly wait: a run takes a third of a core."""
WAITS = frozenset({"server reluctant"})
"""Programs that answer late, each time: an hour, in which the processors idle."""
BUSY = 2
"""Processes that never rest."""
RUN_SECONDS = foreign_programs.RUN_SECONDS = 3600  # theirs is for the profile that tests run
Wrong = list[str]
"""What is wrong with a program, in sentences."""


@dataclass(frozen=True)
class Task:
    """One program, judged once."""

    name: str
    run: Callable[[Path], Wrong]
    """In a folder of its own."""
    at_a_time: float = 1
    """How many such tasks may run beside each other; beside any others if there is no limit."""


def plan(commit: str) -> Iterator[Task]:
    """Every task: those of others first, which have found most."""
    seed = int(commit[:6], 16)
    others = {f"{it.side} {it.name}": it for it in (*programs("client"), *programs("server"))}
    for name in sorted(others, key=lambda name: name not in WAITS):
        at_a_time = math.inf if name in WAITS else AT_A_TIME
        yield Task(name, partial(foreign, others[name], seed), at_a_time)
    for language, axes in ENGINES.items():
        for words in ("Viewer", *(f"Adapter {each}" for each in axes)):
            yield Task(f"{language} {words}", partial(engine, language, words, seed), AT_A_TIME)
    # Alone, for the harness starts a dozen of them at a time.
    for version in BLENDERS:
        yield Task(f"blender {version} Adapter", partial(blender, version, seed))
        yield Task(f"tests of blender {version}", partial(blenders.tried, version))
    yield Task("cpp under Wine", partial(passing, [WINE], os.environ))
    for name in PAIR:
        for each in range(seed, seed + PAIR_SEEDS):
            yield Task(f"our {name}, seed {each}", partial(own, name, each))
        yield Task(f"our {name}, {BUSY} busy beside it", partial(hurried, name, seed))


def foreign(program: Program, seed: int, scratch: Path) -> Wrong:
    """Judge a foreign program: the verdict has to be what is pinned."""
    return differences(program, judge(program, scratch, profile="full", seed=seed))


def engine(language: str, program_and_axes: str, seed: int, scratch: Path) -> Wrong:
    """Judge a client for an engine: anything but a run that conforms is wrong."""
    program, *axes = program_and_axes.split()
    if missing := [each for each in COMPILERS[language] if not shutil.which(each)]:
        raise Lacking(f"{', '.join(missing)} is not installed")
    command = shlex.join([*built(language, program, scratch), *axes])
    words = ("--stand-in-cuda",) if language == "cpp" else ()
    how = "--adapter" if axes else "--launch"
    return judging(seed, scratch, "client", how, command, *words)


def blender(version: str, seed: int, scratch: Path) -> Wrong:
    """Judge the extension for Blender: anything but a run that conforms is wrong."""
    return judging(seed, scratch, "client", *adapter(installed(version), scratch))


def own(name: str, seed: int, scratch: Path) -> Wrong:
    """Judge one of the pair: anything but a run that conforms is wrong."""
    side, how, module, environment = PAIR[name]
    command = f'"{sys.executable}" -m {module.format(AXES[seed % len(AXES)])}'
    return judging(seed, scratch, side, how, command, **environment)


def judging(seed: int, scratch: Path, *words: str, **environment: str) -> Wrong:
    """What is wrong with a program that has to conform, by its report in `scratch`."""
    report = scratch / REPORT
    ended = subprocess.run(
        [
            *(sys.executable, "-m", "splatbus_conformance", "--plain", *words),
            *("--json", str(report), "--shrink", "0", "--scripts", str(scratch)),
            *("--profile", "full", "--seed", str(seed)),
        ],
        cwd=scratch,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        timeout=RUN_SECONDS,
    )
    if not report.is_file():
        return [f"no report was written: {ended.stdout[-400:]}"]
    told = json.loads(report.read_text("utf-8"))
    found = [(each["id"], it) for each in told["requirements"] for it in each["results"]]
    wrong = [
        f"{id}: {it['verdict']} in {it['check']}: {it['text'][:400]}"
        for id, it in (*found, *(("", other) for other in told["others"]))
        if it["verdict"] not in GOOD
    ]
    if ended.returncode and not wrong:
        wrong = [f"it ended with {ended.returncode}: {told['summary']}"]
    return wrong


def hurried(name: str, seed: int, scratch: Path) -> Wrong:
    """Judge one of the pair beside processes that never rest: it may show less, and breaks
    nothing.
    """
    with contextlib.ExitStack() as stack:
        for _ in range(BUSY):
            busy = stack.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            stack.callback(busy.kill)
        return own(name, seed, scratch)


def long(words: list[str]) -> int:
    """Go on with the plan for so many minutes; 1 if something is wrong, or is not done."""
    parser = argparse.ArgumentParser(prog="python -m tests long", description=__doc__)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="of this sitting")
    parser.add_argument("--behind", action="store_true", help="only say how far the result is")
    given = parser.parse_args(words)
    if given.behind:
        if told := behind():
            print(f"== {told}")
        return 0
    until = time.monotonic() + 60 * given.minutes
    if changed := git("status", "--porcelain", "--", *SOURCES):
        print(f"a result is of a commit, and this is of none yet:\n{changed}")
        return 2
    state = begun()
    tasks = [task for task in plan(state["commit"]) if task.name not in state["tasks"]]
    print(f"{len(state['tasks'])} tasks are done, {len(tasks)} are left")
    sit(tasks, state, until)
    for sentence in (told := sentences(state)):
        print(sentence)
    return 1 if told[1:] or not whole(state) else 0


def begun() -> dict[str, Any]:
    """The state of the sittings so far, if they were of these sources."""
    if RESULT.is_file():
        state: dict[str, Any] = json.loads(RESULT.read_text("utf-8"))
        with contextlib.suppress(subprocess.CalledProcessError):  # a commit that is not here
            if not git("diff", "--name-only", state["commit"], "--", *SOURCES):
                return state
        print(f"the sources have changed since {state['commit'][:12]}: all begins anew")
    return {"commit": git("rev-parse", "HEAD"), "seconds": 0, "tasks": {}}


def sit(tasks: list[Task], state: dict[str, Any], until: float) -> None:
    """Do tasks until it is time; each is stored as soon as it is done."""
    running: dict[Future[Wrong], Task] = {}
    with ThreadPoolExecutor(len(tasks) or 1) as pool:
        while running or (tasks and time.monotonic() < until):
            while tasks and fits(tasks[0], list(running.values())) and time.monotonic() < until:
                task = tasks.pop(0)
                running[pool.submit(done, task)] = task
            began = time.monotonic()
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            state["seconds"] += round(time.monotonic() - began)
            for future in finished:
                task, wrong = running.pop(future), future.result()
                state["tasks"][task.name] = wrong
                print(f"{task.name}: {'; '.join(wrong) or 'as it must be'}", flush=True)
            save(state)


def fits(task: Task, running: list[Task]) -> bool:
    """Whether a task may begin beside those that run."""
    beside = [it.at_a_time for it in running if it.at_a_time < math.inf]
    alike = {*beside} <= {task.at_a_time}
    return task.at_a_time == math.inf or (alike and len(beside) < task.at_a_time)


def done(task: Task) -> Wrong:
    """What came of a task."""
    with tempfile.TemporaryDirectory(prefix="splatbus-long-") as folder:
        try:
            return task.run(Path(folder))
        except (Lacking, RuntimeError, subprocess.TimeoutExpired) as error:
            return [str(error)[-400:]]


def save(state: dict[str, Any]) -> None:
    """Store it, whole or not at all."""
    RESULT.parent.mkdir(exist_ok=True)
    beside = RESULT.with_suffix(".new")
    beside.write_text(json.dumps(state, indent=1, ensure_ascii=False) + "\n", "utf-8")
    beside.replace(RESULT)


def whole(state: dict[str, Any]) -> bool:
    """Everything in the plan was done."""
    return all(task.name in state["tasks"] for task in plan(state["commit"]))


def sentences(state: dict[str, Any]) -> Wrong:
    """How far it is, and everything that is wrong."""
    planned = [task.name for task in plan(state["commit"])]
    done = sum(name in state["tasks"] for name in planned)
    return [
        f"{done} of {len(planned)} tasks in {state['seconds'] / 3600:.1f} h",
        *(f"{name}: {'; '.join(wrong)}" for name, wrong in state["tasks"].items() if wrong),
    ]


def behind() -> str:
    """What the stored result lacks, as a sentence; how far it is behind only where git tells."""
    if not RESULT.is_file():
        return "there is no result of `python -m tests long` yet"
    state = json.loads(RESULT.read_text("utf-8"))
    told = [] if whole(state) else [f"not whole ({sentences(state)[0]})"]
    with contextlib.suppress(OSError, subprocess.CalledProcessError):
        count = int(git("rev-list", "--count", f"{state['commit']}..HEAD", "--", *SOURCES))
        told += [f"{count} changes of the sources behind"] if count else []
    return f"the result of `python -m tests long` is {' and '.join(told)}" if told else ""


def git(*words: str) -> str:
    """What git prints. Raises OSError, CalledProcessError."""
    line = ["git", *words]
    ended = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True)
    return ended.stdout.strip()


if __name__ == "__main__":
    sys.exit(long(sys.argv[1:]))
