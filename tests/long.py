"""`python -m tests long`: all that takes longer than a test may, in as many sittings as it takes.

Each foreign program and each client for an engine, in two profiles with three seeds, some at a
time; the extension in each Blender likewise, the C++ client's programs for Windows under Wine, and
the reference pair with twenty, alone on the machine; the pair with five more beside two processes
that never rest; 1,500 mutants made by machine. What is done stays done as long as the sources of
what is judged, and of what judges, are those of the first sitting; the results are stored beside.
"""

import argparse
import contextlib
import itertools
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
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
MUTANTS = RESULT.with_name("machine.json")
STAND_IN = (
    "conformance/splatbus_conformance/images/memory/cuda_stand_in",
    "conformance/splatbus_conformance/trials/testee/device_probe.py",
)
"""What only a run with --stand-in-cuda uses: its task is named by them."""
ASKS_FOR_IT = "--stand-in-cuda"
NO_PART = (
    *(f":(exclude){each}" for each in STAND_IN),
    ":(exclude)*.md",
    ":(exclude)*.jpg",
    ":(exclude)*.png",
    ":(exclude)conformance/guides",
    ":(exclude)conformance/site",
    ":(exclude)tests/zoo/mutants/stateful",
    ":(exclude)tests/zoo/mutants/v1_0",
    ":(exclude)tests/zoo/mutants/v1_1",
    ":(exclude)tests/zoo/variations",
    ":(exclude,glob)tests/zoo/**/test_*.py",
    ":(exclude)reference_client/blender",
    ":(exclude)reference_client/cpp",
    ":(exclude)reference_client/csharp",
    ":(exclude)reference_client/splatbus_viewer/window",
    ":(exclude)reference_server/examples",
    ":(exclude)reference_server/splatbus_splats",
    ":(exclude)schemas/splatbus_schemas/types",
    ":(exclude)tests/foreign/clients",
    ":(exclude)tests/foreign/conftest.py",
    ":(exclude)tests/foreign/servers",
    ":(exclude)tests/foreign/test_*.py",
)
"""Nothing here judges, or is judged here but by tasks that are named by it."""
JUDGES = ("conformance", "schemas/splatbus_wire", "tests/zoo", *NO_PART)
JUDGED = (*JUDGES, "schemas", "reference_client", "reference_server", "tests/foreign")
"""A result is of these sources."""
WINE = "tests/engines/under_wine.py"
ENGINES = {"csharp": ("unity",), "cpp": ("unreal", "opengl", "opengl device")}
"""The clients for engines, each in folders of its own, and the axes of their adapters."""
NO_SOURCES = (".md", ".meta", ".pyc")
COMPILERS = {"csharp": ("mcs", "mono"), "cpp": ("g++",)}
PROFILES = ("quick", "full")
FOREIGN_SEEDS = range(3)
PAIR_SEEDS = range(20)
BUSY_SEEDS = range(20, 25)
COUNT, SEED = 1500, 2
"""Of the mutants."""
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
BUSY = 2
"""Processes that never rest."""
RUN_SECONDS = foreign_programs.RUN_SECONDS = 3600  # theirs is for the profile that tests run
Outcome = dict[str, Any]
"""What is stored of a task: what is wrong, in sentences; of our pair, what verdict is no pass."""


@dataclass(frozen=True)
class Task:
    """One program, judged once."""

    name: str
    run: Callable[[Path], Outcome]
    """In a folder of its own."""
    at_a_time: int = 1
    """How many such tasks may run beside each other."""


def plan() -> Iterator[Task]:
    """Every task but the mutants: those of others first, which have found most."""
    for seed, profile in itertools.product(FOREIGN_SEEDS, PROFILES):
        for program in (*programs("client"), *programs("server")):
            name = f"{program.side} {program.name}, {profile}, seed {seed}, of {made_of(program)}"
            yield Task(name, partial(foreign, program, profile, seed), AT_A_TIME)
        for language, axes in ENGINES.items():
            for words in ("Viewer", *(f"Adapter {each}" for each in axes)):
                sources = digest(f"reference_client/{language}", *STAND_IN)
                name = f"{language} {words}, {profile}, seed {seed}, of {sources}"
                yield Task(name, partial(engine, language, words, profile, seed), AT_A_TIME)
    # Alone, for the harness starts a dozen of them at a time.
    for seed, profile, version in itertools.product(FOREIGN_SEEDS, PROFILES, BLENDERS):
        name = f"blender {version} Adapter, {profile}, seed {seed}, of {digest(*blenders.SOURCES)}"
        yield Task(name, partial(blender, version, profile, seed))
    for version in BLENDERS:
        name = f"tests of blender {version}, of {digest(*blenders.TESTED)}"
        yield Task(name, partial(blenders.tried, version))
    sources = digest("reference_client/cpp", "tests/engines")
    yield Task(f"cpp under Wine, of {sources}", partial(passing, [WINE], os.environ))
    for profile in PROFILES:
        for seed in PAIR_SEEDS:
            for name in PAIR:
                yield Task(f"our {name}, {profile}, seed {seed}", partial(own, name, profile, seed))
        for seed in BUSY_SEEDS:
            for name in PAIR:
                told = f"our {name}, {BUSY} busy beside it, {profile}, seed {seed}"
                yield Task(told, partial(hurried, name, profile, seed))


def made_of(program: Program) -> str:
    """Its sources, those of programs that it borrows from, and the stand-in if it asks for that."""
    borrows = re.findall(r"\.\./(\w+)", " ".join((program.launch, *program.build)))
    folders = (program.folder, *(program.folder.with_name(each) for each in borrows))
    paths = [str(each.relative_to(ROOT)) for each in folders]
    return digest(*paths, *(STAND_IN if ASKS_FOR_IT in program.options else ()))


def foreign(program: Program, profile: str, seed: int, scratch: Path) -> Outcome:
    """Judge a foreign program: the verdict has to be what is pinned."""
    try:
        return {"wrong": differences(program, judge(program, scratch, profile=profile, seed=seed))}
    except Lacking as missing:
        return {"wrong": [str(missing)]}


@cache
def digest(*paths: str) -> str:
    """What a task is made of beside what all are: with other sources it is another task."""
    found = [ROOT / each for each in paths]
    files = [each for path in found for each in (path, *path.rglob("*")) if each.is_file()]
    sources = sorted(each for each in files if each.suffix not in NO_SOURCES)
    return sha256(b"".join(each.read_bytes() for each in sources)).hexdigest()[:10]


def engine(language: str, program_and_axes: str, profile: str, seed: int, scratch: Path) -> Outcome:
    """Judge a client for an engine: anything but a run that conforms is wrong."""
    program, *axes = program_and_axes.split()
    if missing := [each for each in COMPILERS[language] if not shutil.which(each)]:
        return {"wrong": [f"{', '.join(missing)} is not installed"]}
    command = shlex.join([*built(language, program, scratch), *axes])
    how = "--adapter" if axes else "--launch"
    words = (ASKS_FOR_IT,) if language == "cpp" else ()
    ended = judging("client", how, command, {}, profile, seed, scratch, *words)
    return {"wrong": outcome(ended, scratch)["wrong"]}


def blender(version: str, profile: str, seed: int, scratch: Path) -> Outcome:
    """Judge the extension for Blender: anything but a run that conforms is wrong."""
    how, command, *words = adapter(installed(version), scratch)
    ended = judging("client", how, command, {}, profile, seed, scratch, *words)
    return {"wrong": outcome(ended, scratch)["wrong"]}


def own(name: str, profile: str, seed: int, scratch: Path) -> Outcome:
    """Judge one of the pair: anything but a run that conforms is wrong."""
    return outcome(judging_own(name, profile, seed, scratch), scratch)


def judging_own(
    name: str, profile: str, seed: int, scratch: Path
) -> subprocess.CompletedProcess[str]:
    """Have the harness judge one of the pair."""
    side, how, module, environment = PAIR[name]
    command = f'"{sys.executable}" -m {module.format(AXES[seed % len(AXES)])}'
    return judging(side, how, command, environment, profile, seed, scratch)


def judging(
    side: str,
    how: str,
    command: str,
    environment: dict[str, str],
    profile: str,
    seed: int,
    scratch: Path,
    *words: str,
) -> subprocess.CompletedProcess[str]:
    """Have the harness judge a program, and write its report into `scratch`."""
    line = [sys.executable, "-m", "splatbus_conformance", "--plain", side]
    line += [how, command, "--json", str(scratch / REPORT), "--shrink", "0"]
    line += ["--scripts", str(scratch), "--profile", profile, "--seed", str(seed), *words]
    return subprocess.run(
        line,
        cwd=scratch,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        timeout=RUN_SECONDS,
    )


def outcome(ended: subprocess.CompletedProcess[str], scratch: Path) -> Outcome:
    """What is wrong with a program that has to conform, and which verdicts are no passes."""
    report = scratch / REPORT
    if not report.is_file():
        return {"wrong": [f"no report was written: {ended.stdout[-400:]}"]}
    told = json.loads(report.read_text("utf-8"))
    verdicts = {it["id"]: it["verdict"] for it in told["requirements"]}
    found = [(each["id"], it) for each in told["requirements"] for it in each["results"]]
    wrong = [
        f"{id}: {it['verdict']} in {it['check']}: {it['text'][:400]}"
        for id, it in (*found, *(("", other) for other in told["others"]))
        if it["verdict"] not in GOOD
    ]
    if ended.returncode and not wrong:
        wrong = [f"it ended with {ended.returncode}: {told['summary']}"]
    return {"wrong": wrong, "others": {k: v for k, v in verdicts.items() if v != "pass"}}


def hurried(name: str, profile: str, seed: int, scratch: Path) -> Outcome:
    """Judge one of the pair beside processes that never rest: it may show less, and breaks nothing.

    Which checks came to no verdict is not kept, for it hangs on the machine.
    """
    with contextlib.ExitStack() as stack:
        for _ in range(BUSY):
            busy = stack.enter_context(subprocess.Popen([sys.executable, "-c", "while True: pass"]))
            stack.callback(busy.kill)
        return {"wrong": own(name, profile, seed, scratch)["wrong"]}


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
    if changed := git("status", "--porcelain", "--", *JUDGED):
        print(f"a result is of a commit, and this is of none yet:\n{changed}")
        return 2
    state = begun()
    tasks = [task for task in plan() if task.name not in state["tasks"]]
    print(f"{len(state['tasks'])} tasks are done, {len(tasks)} are left, then {COUNT} mutants")
    for at_a_time, alike in itertools.groupby(tasks, lambda task: task.at_a_time):
        sit(list(alike), state, until, at_a_time)
    if time.monotonic() < until:
        mutants(state, until)
    for sentence in (told := sentences(state)):
        print(sentence)
    return 1 if told[1:] or not whole(state) else 0


def begun() -> dict[str, Any]:
    """The state of the sittings so far, if they were of these sources."""
    head = git("rev-parse", "HEAD")
    if RESULT.is_file():
        state: dict[str, Any] = json.loads(RESULT.read_text("utf-8"))
        with contextlib.suppress(subprocess.CalledProcessError):  # a commit that is not here
            if not git("diff", "--name-only", state["commit"], "--", *JUDGED):
                planned = {task.name for task in plan()}
                state["tasks"] = {k: it for k, it in state["tasks"].items() if k in planned}
                return state
        print(f"the sources have changed since {state['commit'][:12]}: all begins anew")
        MUTANTS.unlink(missing_ok=True)
    return {"commit": head, "seconds": 0, "tasks": {}, "mutants": []}


def sit(tasks: list[Task], state: dict[str, Any], until: float, at_a_time: int) -> None:
    """Do tasks, so many at a time, until it is time; each is stored as soon as it is done."""
    running: dict[Future[Outcome], Task] = {}
    with ThreadPoolExecutor(at_a_time) as pool:
        while running or (tasks and time.monotonic() < until):
            while tasks and len(running) < at_a_time and time.monotonic() < until:
                task = tasks.pop(0)
                running[pool.submit(done, task)] = task
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                task, outcome = running.pop(future), future.result()
                state["seconds"] += outcome.pop("seconds")
                state["tasks"][task.name] = outcome
                save(state)
                print(f"{task.name}: {'; '.join(outcome['wrong']) or 'as it must be'}", flush=True)


def done(task: Task) -> Outcome:
    """What came of a task, and how long it took."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="splatbus-long-") as folder:
        try:
            outcome = task.run(Path(folder))
        except (Lacking, RuntimeError, subprocess.TimeoutExpired) as error:
            outcome = {"wrong": [str(error)[-400:]]}
    return {**outcome, "seconds": round(time.monotonic() - began)}


def mutants(state: dict[str, Any], until: float) -> None:
    """Go on with the mutants; what was judged stays when they are interrupted."""
    began = time.monotonic()
    line = [sys.executable, "-m", "tests.zoo.machine"]
    line += ["--count", str(COUNT), "--seed", str(SEED), "--json", str(MUTANTS), "--resume"]
    MUTANTS.parent.mkdir(exist_ok=True)
    process = subprocess.Popen(line, cwd=ROOT)
    try:
        process.wait(None if until == float("inf") else until - time.monotonic())
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        process.wait()
    if MUTANTS.is_file():
        state["mutants"] = json.loads(MUTANTS.read_text("utf-8"))["summary"]
    state["judged"] = process.returncode == 0
    state["seconds"] += round(time.monotonic() - began)
    save(state)


def save(state: dict[str, Any]) -> None:
    """Store it, whole or not at all."""
    RESULT.parent.mkdir(exist_ok=True)
    beside = RESULT.with_suffix(".new")
    beside.write_text(json.dumps(state, indent=1, ensure_ascii=False) + "\n", "utf-8")
    beside.replace(RESULT)


def whole(state: dict[str, Any]) -> bool:
    """Everything in the plan was done."""
    return bool(state.get("judged")) and all(task.name in state["tasks"] for task in plan())


def sentences(state: dict[str, Any]) -> list[str]:
    """How far it is, and everything that is wrong."""
    tasks: dict[str, Outcome] = state["tasks"]
    planned = {task.name for task in plan()}
    done = f"{len(planned & tasks.keys())} of {len(planned)} tasks"
    return [
        f"{done} in {state['seconds'] / 3600:.1f} h; "
        + ("; ".join(state["mutants"]) or "no mutants yet"),
        *(f"{name}: {'; '.join(it['wrong'])}" for name, it in tasks.items() if it["wrong"]),
        *differing(tasks),
    ]


def differing(tasks: dict[str, Outcome]) -> Iterator[str]:
    """The verdicts on our pair that hang on the seed; an adapter's, beyond those of its axes."""
    for name, profile in itertools.product(PAIR, PROFILES):
        alike: dict[int, list[dict[str, str]]] = {}
        for seed in PAIR_SEEDS:
            outcome = tasks.get(f"our {name}, {profile}, seed {seed}", {})
            if "others" in outcome:
                axes = seed % len(AXES) if "{}" in PAIR[name][2] else 0
                alike.setdefault(axes, []).append(outcome["others"])
        for found in alike.values():
            for requirement in sorted(set().union(*found)):
                told = [each.get(requirement, "pass") for each in found]
                if len(set(told)) > 1:
                    counts = ", ".join(f"{it} {told.count(it)} times" for it in sorted(set(told)))
                    yield f"our {name}, {profile}: {requirement} is {counts}"


def behind() -> str:
    """What the stored result lacks, as a sentence; how far it is behind only where git tells."""
    if not RESULT.is_file():
        return "there is no result of `python -m tests long` yet"
    state = json.loads(RESULT.read_text("utf-8"))
    told = [] if whole(state) else [f"not whole ({sentences(state)[0]})"]
    with contextlib.suppress(OSError, subprocess.CalledProcessError):
        count = int(git("rev-list", "--count", f"{state['commit']}..HEAD", "--", *JUDGES))
        told += [f"{count} changes of harness and wire behind"] if count else []
    return f"the result of `python -m tests long` is {' and '.join(told)}" if told else ""


def git(*words: str) -> str:
    """What git prints. Raises OSError, CalledProcessError."""
    line = ["git", *words]
    ended = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True)
    return ended.stdout.strip()


if __name__ == "__main__":
    sys.exit(long(sys.argv[1:]))
