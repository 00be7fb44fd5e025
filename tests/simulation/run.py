"""Sessions by their seeds: one, to be read, or many, beside each other.

python -m tests.simulation --seed 123 -v
python -m tests.simulation --sessions 100000 --jobs 2
"""

from __future__ import annotations

import argparse
import subprocess
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tests.simulation.machine.world import BrokenError
from tests.simulation.session import play

ROOT = Path(__file__).resolve().parents[2]
BATCH = 200
"""Sessions that a process plays before it reports."""


class Played(NamedTuple):
    """How often each invariant was looked at in many sessions, and what broke, by seed."""

    looked: Counter[str]
    broken: dict[int, str]


def play_all(first: int, count: int) -> Played:
    """Plays the sessions of so many seeds."""
    played = Played(Counter(), {})
    for seed in range(first, first + count):
        try:
            played.looked.update(play(seed).looked)
        except BrokenError as error:
            played.broken[seed] = str(error)
    return played


def replay(seed: int, is_told: bool) -> int:
    """Plays one session; its exit status."""
    lines: list[str] = []
    try:
        world = play(seed, lines.append if is_told else None)
        told, status = f"{world.steps} steps, nothing broken", 0
    except BrokenError as error:
        told, status = str(error), 1
    print(*lines, f"seed {seed}: {told}", sep="\n")
    return status


def commit() -> str:
    """Of what is played, with a sign if it was changed since."""
    command = ("git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude", "*")
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return ended.stdout.strip()


def main(words: list[str]) -> int:
    """Plays what the command line says; exit status 1 if anything broke."""
    parser = argparse.ArgumentParser(prog="python -m tests.simulation", description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="play this session, or begin with it")
    parser.add_argument("-v", "--verbose", action="store_true", help="tell what happens in it")
    parser.add_argument("--sessions", type=int, help="play so many")
    parser.add_argument("--jobs", type=int, default=1, help="in so many processes")
    options = parser.parse_args(words)
    if options.sessions is None:
        return replay(options.seed, options.verbose)
    starts, broken = range(options.seed, options.seed + options.sessions, BATCH), 0
    with ProcessPoolExecutor(options.jobs) as pool:
        sizes = [min(BATCH, starts.stop - start) for start in starts]
        for start, size, played in zip(
            starts, sizes, pool.map(play_all, starts, sizes), strict=True
        ):
            broken += len(played.broken)
            for seed, told in played.broken.items():
                print(f"seed {seed}: {told}")
            print(f"{start + size - options.seed} sessions, {broken} broken", flush=True)
    return 1 if broken else 0
