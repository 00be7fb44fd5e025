"""`python -m tests.zoo.machine`: small changes of the reference's own sources, drawn by seed."""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeVar

from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.selection import RULE
from splatbus_conformance.verdicts import (
    EXIT_CONFORMING,
    EXIT_NOT_CONFORMING,
    Verdict,
)

from tests.zoo.judge import run_harness
from tests.zoo.machine import lines, modules
from tests.zoo.machine.lines import Watched
from tests.zoo.machine.specimens import WATCHED, MachineMade
from tests.zoo.machine.testing import FOLDERS, ROOT, ByTests, watch_tests
from tests.zoo.machine.trials import (
    BY_RULES,
    PHASES,
    TESTS,
    Judged,
    MutantFate,
    Phase,
    judge,
    judging,
)
from tests.zoo.processes import harnesses

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


def main(argv: Sequence[str] | None = None) -> int:
    """Judge mutants that are drawn, or again those that a result says were killed."""
    parser = argparse.ArgumentParser(prog="python -m tests.zoo.machine", description=__doc__)
    parser.add_argument("--count", type=int, metavar="N", default=60, help="how many (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (%(default)s)")
    parser.add_argument("--json", metavar="FILE", help="write what became of each")
    parser.add_argument("--resume", action="store_true", help="go on with what --json FILE holds")
    parser.add_argument(
        "--again", metavar="FILE", help="those that were killed in a FILE of --json must be again"
    )
    arguments = parser.parse_args(argv)
    if arguments.again:
        return judge_again(StoredMutants.read(Path(arguments.again)), arguments.count)
    drawn = modules.draw(arguments.count, arguments.seed)
    path = Path(arguments.json) if arguments.json else None
    if arguments.resume and path and path.exists():
        result = StoredMutants.read(path)
    else:
        result = StoredMutants(arguments.seed, _commit())
    watched = watched_at(result.commit, path and path.with_suffix(".watched.json"))
    left = [it for it in drawn if it.change.name not in result.judged]
    for judged in run([partial(judge, it, watched, result.judged) for it in left]):
        result.judged = {**result.judged, judged.name: judged}  # others read the former
        if path:
            result.save(path)
    in_order = [result.judged[it.change.name] for it in drawn]
    for survivor in in_order:
        if survivor.fate is not MutantFate.KILLED and survivor.tested is ByTests.KILLED:
            _tell(survivor)
    for sentence in sentences(in_order):
        print(sentence, flush=True)
    return EXIT_CONFORMING


def judge_again(former: StoredMutants, count: int) -> int:
    """Whether what was killed most quickly is killed; 1 if not. What is gone is counted."""
    killed = [it for it in former.judged.values() if it.fate is MutantFate.KILLED]
    killed = sorted(killed, key=lambda it: it.seconds)[:count]
    drawn = modules.named(it.name for it in killed)
    alone = {it.name: {it.name: it} for it in killed}
    found = list(run([partial(judge, it, None, alone[it.change.name]) for it in drawn]))
    for survivor in (alive := [it for it in found if it.fate is not MutantFate.KILLED]):
        _tell(survivor)
    gone = len(killed) - len(drawn)
    print(
        f"{len(found) - len(alive)} of {len(found)} are killed again"
        + (f"; {gone} are not there any more" if gone else "")
    )
    return EXIT_NOT_CONFORMING if alive else EXIT_CONFORMING


def run(trials: Sequence[Callable[[], Judged]]) -> Iterator[Judged]:
    """Judge mutants, some at a time, and say what became of each."""
    for done, it in enumerate(_some_at_a_time(trials, WORKERS), 1):
        tests = "" if it.tested is ByTests.UNKNOWN else f", by the tests {it.tested}"
        print(f"{done:4}/{len(trials)}  {it.fate}{tests}  {it.name}", flush=True)
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


def watched_at(commit: str, path: Path | None) -> Mapping[str, Watched]:
    """What the reference executes of this commit: by each check in each phase, and by each test."""
    if path and path.exists():
        members = json.loads(path.read_text("utf-8"))
        if commit and members["commit"] == commit:
            return {name: Watched.from_json(it) for name, it in members["watched"].items()}
    print("which lines does each check execute, and each test?", flush=True)
    jobs = [*(partial(_by_checks, phase) for phase in PHASES)]
    jobs += [partial(_by_tests, folder) for folder in FOLDERS]
    watched: dict[str, Watched] = {}
    for name, found in _some_at_a_time(jobs, WATCHERS):
        watched[name] = watched.get(name, Watched()) | found
        print(f"{name}: {len(found.seconds)} in {sum(found.seconds.values()):.0f} s", flush=True)
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
        report, status, last_words = run_harness(
            MachineMade(WATCHED, phase.side, phase.axes, str(path)),
            ",".join((BY_RULES, *every)),
            WATCHED_SECONDS,
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


def _tell(it: Judged) -> None:
    print(f"\n{it.fate}  {it.name}, line {it.line}", flush=True)
    print(f"  {it.before}  →  {it.after}", flush=True)
    for told in filter(None, (it.by, it.test)):
        print(f"  {told}", flush=True)


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


if __name__ == "__main__":
    sys.exit(main())
