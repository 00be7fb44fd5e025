"""Sessions by their seeds: one, to be read, or many, beside each other.

    python -m tests.simulation --seed 123 -v
    python -m tests.simulation --sessions 100000 --jobs 2

Many are counted in `tests/results/simulation.json`, with the seeds of those that broke something;
interrupted, they go on where they were, as long as the commit is the same.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from tests.simulation.machine.world import BrokenError
from tests.simulation.session import play

ROOT = Path(__file__).resolve().parents[2]
RESULT = ROOT / "tests" / "results" / "simulation.json"
BATCH = 200
"""Sessions that a process plays before it reports."""


class Played(NamedTuple):
    """What many sessions were."""

    sessions: int
    steps: int
    drawn: Counter[str]
    looked: Counter[str]
    broken: dict[int, str]


def play_all(first: int, count: int) -> Played:
    """Plays the sessions of so many seeds."""
    steps, drawn, looked, broken = 0, Counter[str](), Counter[str](), {}
    for seed in range(first, first + count):
        try:
            world = play(seed)
        except BrokenError as error:
            broken[seed] = str(error)
        else:
            steps += world.steps
            drawn += world.drawn
            looked += world.looked
    return Played(count, steps, drawn, looked, broken)


def added(a: Played, b: Played) -> Played:
    """Both together."""
    return Played(
        a.sessions + b.sessions,
        a.steps + b.steps,
        a.drawn + b.drawn,
        a.looked + b.looked,
        a.broken | b.broken,
    )


def replay(seed: int, is_told: bool) -> int:
    """Plays one session; its exit status."""
    lines: list[str] = []
    try:
        world = play(seed, lines.append if is_told else None)
    except BrokenError as error:
        print(*lines, f"seed {seed}: {error}", sep="\n")
        return 1
    print(*lines, sep="\n", end="\n" if lines else "")
    print(f"seed {seed}: {world.steps} steps, {sum(world.looked.values())} looks, nothing broken")
    return 0


def play_beside(total: Played, first: int, count: int, jobs: int) -> Iterator[Played]:
    """Plays what is missing of so many, in so many processes; yields all so far, now and then."""
    begun, began = total.sessions, time.monotonic()
    with ProcessPoolExecutor(jobs) as pool:
        starts = range(first + begun, first + count, BATCH)
        sizes = [min(BATCH, first + count - start) for start in starts]
        for batch in pool.map(play_all, starts, sizes):
            total = added(total, batch)
            for seed, told in batch.broken.items():
                print(f"seed {seed}: {told}", flush=True)
            rate = (total.sessions - begun) / (time.monotonic() - began)
            print(f"{total.sessions} of {count} sessions, {rate:.0f} a second", flush=True)
            yield total


def commit() -> str:
    """Of what is played, with a sign if it was changed since."""
    command = ("git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*")
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return ended.stdout.strip()


def summary(total: Played, first: int) -> dict[str, Any]:
    """What is stored."""
    return {
        "seeds": [first, first + total.sessions - 1],
        "sessions": total.sessions,
        "steps": total.steps,
        "drawn": dict(sorted(total.drawn.items())),
        "looked": dict(sorted(total.looked.items())),
        "broken": {str(seed): told for seed, told in sorted(total.broken.items())},
    }


def stored(path: Path, at: str, first: int) -> tuple[Played, float]:
    """What was played of the same commit before, and in how many seconds."""
    told = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    if told.get("commit") != at or told["seeds"][0] != first:
        return Played(0, 0, Counter(), Counter(), {}), 0.0
    broken = {int(seed): what for seed, what in told["broken"].items()}
    counts = Counter(told["drawn"]), Counter(told["looked"])
    return Played(told["sessions"], told["steps"], *counts, broken), told["seconds"]


def main(words: list[str]) -> int:
    """Plays what the command line says; exit status 1 if anything broke."""
    parser = argparse.ArgumentParser(prog="python -m tests.simulation", description=__doc__)
    parser.add_argument("--seed", type=int, help="play this session, or begin with it")
    parser.add_argument("-v", "--verbose", action="store_true", help="tell what happens in it")
    parser.add_argument("--sessions", type=int, help="play so many")
    parser.add_argument("--jobs", type=int, default=1, help="in so many processes")
    parser.add_argument("--out", type=Path, default=RESULT, help="where the counts are stored")
    options = parser.parse_args(words)
    first = options.seed or 0
    if options.sessions is None:
        return replay(first, options.verbose)
    at, began = commit(), time.monotonic()
    former, before = stored(options.out, at, first)
    options.out.parent.mkdir(exist_ok=True)
    for total in play_beside(former, first, options.sessions, options.jobs):
        seconds = round(before + time.monotonic() - began, 1)
        told = {"commit": at, "jobs": options.jobs, "seconds": seconds} | summary(total, first)
        options.out.write_text(json.dumps(told, indent=1) + "\n", "utf-8")
        former = total
    print(f"{former.sessions} sessions, {len(former.broken)} broken")
    return 1 if former.broken else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
