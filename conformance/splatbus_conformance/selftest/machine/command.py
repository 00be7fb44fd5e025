"""`splatbus-conformance selftest --machine`."""

import argparse
import json
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.text import Text

from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.selection import RULE
from splatbus_conformance.selftest.judge import run_harness
from splatbus_conformance.selftest.machine import lines, modules, specimens
from splatbus_conformance.selftest.machine.lines import Watched
from splatbus_conformance.selftest.machine.testing import FOLDERS, ROOT, ByTests, watch_tests
from splatbus_conformance.selftest.machine.trials import (
    BY_RULES,
    PHASES,
    TESTS,
    Judged,
    MutantFate,
    Phase,
    judge,
    judging,
)
from splatbus_conformance.selftest.processes import harnesses
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NOT_CONFORMING,
    Verdict,
)

WORKERS = 8
"""Most of a run is waiting, though less than in the zoo, for there are tests to run too."""
WATCHERS = 4
WATCHED_SECONDS = 900.0
ENDING_SECONDS = 0.2

T = TypeVar("T")


@dataclass
class StoredMutants:
    """What is stored: more is added until all that were drawn are judged."""

    seed: int
    commit: str
    judged: dict[str, Judged] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        """Write it, so that an interruption leaves the former or this."""
        found = list(self.judged.values())
        members = {
            "format": "3",
            "summary": sentences(found),
            "seed": self.seed,
            "commit": self.commit,
        }
        head = json.dumps(members, ensure_ascii=False)
        rows = ",\n".join(json.dumps(it.as_json(), ensure_ascii=False) for it in found)
        _write(path, f'{head[:-1]},\n"judged": [\n{rows}\n]}}\n')

    @classmethod
    def read(cls, path: Path) -> "StoredMutants":
        """What was saved."""
        members = json.loads(path.read_text("utf-8"))
        judged = {it["name"]: Judged.from_json(it) for it in members["judged"]}
        return cls(members["seed"], members["commit"], judged)


def machine(arguments: argparse.Namespace, out: Console) -> int:
    """Judge mutants that are drawn, or again those that a result says were killed."""
    if arguments.again:
        return judge_again(StoredMutants.read(Path(arguments.again)), arguments.count, out)
    drawn = modules.draw(arguments.count, arguments.seed)
    path = Path(arguments.json) if arguments.json else None
    if arguments.resume and path and path.exists():
        result = StoredMutants.read(path)
    else:
        result = StoredMutants(arguments.seed, _commit())
    watched = watched_at(result.commit, path and path.with_suffix(".watched.json"), out)
    left = [it for it in drawn if it.change.name not in result.judged]
    for judged in run([partial(judge, it, watched, result.judged) for it in left], out):
        result.judged = {**result.judged, judged.name: judged}  # others read the former
        if path:
            result.save(path)
    in_order = [result.judged[it.change.name] for it in drawn]
    for survivor in in_order:
        if survivor.fate is not MutantFate.KILLED and survivor.tested is ByTests.KILLED:
            _tell(survivor, out)
    for sentence in sentences(in_order):
        out.print(Text(sentence))
    return EXIT_CONFORMING


def judge_again(former: StoredMutants, count: int, out: Console) -> int:
    """Whether what was killed most quickly is killed; 1 if not. What is gone is counted."""
    killed = [it for it in former.judged.values() if it.fate is MutantFate.KILLED]
    killed = sorted(killed, key=lambda it: it.seconds)[:count]
    drawn = modules.named(it.name for it in killed)
    alone = {it.name: {it.name: it} for it in killed}
    found = list(run([partial(judge, it, None, alone[it.change.name]) for it in drawn], out))
    for survivor in (alive := [it for it in found if it.fate is not MutantFate.KILLED]):
        _tell(survivor, out)
    gone = len(killed) - len(drawn)
    out.print(
        Text(
            f"{len(found) - len(alive)} of {len(found)} are killed again"
            + (f"; {gone} are not there any more" if gone else "")
        )
    )
    return EXIT_NOT_CONFORMING if alive else EXIT_CONFORMING


def run(trials: Sequence[Callable[[], Judged]], out: Console) -> Iterator[Judged]:
    """Judge mutants, some at a time, and say what became of each."""
    for done, it in enumerate(_some_at_a_time(trials, WORKERS), 1):
        tests = "" if it.tested is ByTests.UNKNOWN else f", by the tests {it.tested}"
        out.print(Text(f"{done:4}/{len(trials)}  {it.fate}{tests}  {it.name}"))
        yield it


def _some_at_a_time(jobs: Sequence[Callable[[], T]], workers: int) -> Iterator[T]:
    """What each comes to, as it does; whatever a job has started ends with this."""
    pool = ThreadPoolExecutor(workers)
    futures = [pool.submit(job) for job in jobs]
    try:
        for future in as_completed(futures):
            yield future.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        while not all(future.done() for future in futures):  # one run is followed by another
            harnesses.stop_all()
            time.sleep(ENDING_SECONDS)
        pool.shutdown()


def watched_at(commit: str, path: Path | None, out: Console) -> Mapping[str, Watched]:
    """What the reference executes of this commit: by each check in each phase, and by each test."""
    if path and path.exists():
        members = json.loads(path.read_text("utf-8"))
        if commit and members["commit"] == commit:
            return {name: Watched.from_json(it) for name, it in members["watched"].items()}
    out.print(Text("which lines does each check execute, and each test?"))
    jobs = [*(partial(_by_checks, phase) for phase in PHASES)]
    jobs += [partial(_by_tests, folder) for folder in FOLDERS]
    watched: dict[str, Watched] = {}
    for name, found in _some_at_a_time(jobs, WATCHERS):
        watched[name] = watched.get(name, Watched()) | found
        out.print(Text(f"{name}: {len(found.seconds)} in {sum(found.seconds.values()):.0f} s"))
    if path:
        members = {name: it.as_json() for name, it in watched.items()}
        _write(path, json.dumps({"commit": commit, "watched": members}))
    return watched


def _by_tests(folder: str) -> tuple[str, Watched]:
    return TESTS, watch_tests(folder)


def _by_checks(phase: Phase) -> tuple[str, Watched]:
    every = [it.name for it in checks_of(phase.side)]  # named ones run in any profile
    with tempfile.TemporaryDirectory(prefix="splatbus-lines-") as folder:
        path = Path(folder, "lines")
        now = lines.now_of(path)
        lines.nobody_yet(now)
        name = specimens.named(specimens.WATCHED, phase.side, phase.axes, str(path))
        report, status, last_words = run_harness(
            name,
            phase.side,
            ",".join((BY_RULES, *every)),
            WATCHED_SECONDS,
            phase.axes,
            environment=phase.environment,
            main=partial(judging, str(now), ()),
            command=phase.command,
        )
        if report is None or status not in (EXIT_CONFORMING, EXIT_NOT_CONFORMING):
            raise RuntimeError(f"the reference was not judged while watched: {last_words}")
        executed = lines.noted(path.read_text("utf-8"))
    seconds = {
        it["check"]: it["seconds"]
        for requirement in report["requirements"]
        for it in requirement["results"]
        if it["check"] != RULE and it["verdict"] != Verdict.SKIP
    }
    return phase.name, Watched(executed, seconds)


def sentences(judged: Iterable[Judged]) -> list[str]:
    """The two figures, and what is left out of them."""
    every = list(judged)
    executed = [it for it in every if it.fate not in (MutantFate.UNTOUCHED, MutantFate.UNMET)]
    tested = [it for it in every if it.tested is ByTests.KILLED and it.fate is not MutantFate.UNMET]
    both = [it for it in tested if it in executed]
    counts = {fate: sum(it.fate is fate for it in every) for fate in MutantFate}
    return [
        f"{_share(executed)} in lines that a run executes die by the harness",
        f"{_share(tested)} that a test kills die by the harness",
        f"{_share(both)} of which both is true die by the harness",
        "; ".join(f"{fate}: {count}" for fate, count in counts.items() if count),
    ]


def _share(judged: Sequence[Judged]) -> str:
    killed = sum(it.fate is MutantFate.KILLED for it in judged)
    return f"{killed} of {len(judged)} ({killed / max(1, len(judged)):.1%})"


def _tell(it: Judged, out: Console) -> None:
    out.print(Text(f"\n{it.fate}  {it.name}, line {it.line}"))
    out.print(Text(f"  {it.before}  →  {it.after}"))
    for told in filter(None, (it.by, it.test)):
        out.print(Text(f"  {told}"))


def _write(path: Path, text: str) -> None:
    """Whole, or not at all."""
    beside = path.with_suffix(".new")
    beside.write_text(text, "utf-8")
    beside.replace(path)


def _commit() -> str:
    """Of the checkout; nothing where there is no git."""
    line = ["git", "rev-parse", "HEAD"]
    try:
        return subprocess.run(line, cwd=ROOT, capture_output=True, text=True).stdout.strip()
    except OSError:
        return ""
