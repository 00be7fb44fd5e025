"""Fuzzes all targets, or one, and adds up what was done; interrupted, it goes on another time.

    python -m tests.fuzz --seconds 60
    python -m tests.fuzz --seconds 600 --jobs 2 --long --keep

With `--long` the counts are added to `tests/results/fuzz.json`, as long as the commit is the same.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

from tests.fuzz import corpus
from tests.fuzz.loop import Fuzzed, fuzz, shortest
from tests.fuzz.reach import Reach
from tests.fuzz.targets import TARGETS
from tests.simulation.run import ROOT, commit

RESULT = ROOT / "tests" / "results" / "fuzz.json"
MOST_KEPT_BYTES = 16_000
"""Of the inputs of a target that the repository keeps."""


def keep(name: str, inputs: list[bytes]) -> None:
    """Adds to the repository what reaches further than what is there, the short ones first."""
    reach = Reach(TARGETS[name])
    for data in corpus.seeds(name):
        reach.run(data)
    former = corpus.found(name)
    for data in former:
        reach.run(data)
    size = sum(map(len, former))
    added = []
    for data in sorted(inputs, key=len):
        if size + len(data) <= MOST_KEPT_BYTES and reach.run(data):
            added.append(data)
            size += len(data)
    if added:
        corpus.keep(name, [*former, *added])


def add(path: Path, results: dict[str, Fuzzed]) -> dict[str, Any]:
    """Adds the counts to those stored of the same commit, target by target; returns them all."""
    told: dict[str, Any] = {"commit": commit(), "targets": {}}
    if path.is_file():
        former = json.loads(path.read_text("utf-8"))
        told = former if former["commit"] == told["commit"] else told
    for name, result in results.items():
        row = told["targets"].setdefault(name, {"sittings": 0})
        row["sittings"] += 1
        row["executions"] = row.get("executions", 0) + result.executions
        row["bytes"] = row.get("bytes", 0) + result.size
        row["seconds"] = round(row.get("seconds", 0) + result.seconds, 1)
        row["reached"] = max(row.get("reached", 0), result.reached)
        faults = {where: data.decode("latin-1") for where, data in result.faults.items()}
        row["faults"] = row.get("faults", {}) | faults
    rows = told["targets"].values()
    told["bytes"] = sum(row["bytes"] for row in rows)
    told["executions"] = sum(row["executions"] for row in rows)
    told["faults"] = sum(len(row["faults"]) for row in rows)
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(told, indent=1) + "\n", "utf-8")
    return told


def main(words: list[str]) -> int:
    """Fuzzes as the command line says; exit status 1 if there was a fault."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all targets together")
    parser.add_argument("--target", choices=TARGETS, help="this one only")
    parser.add_argument("--seed", type=int, default=0, help="of what is drawn")
    parser.add_argument("--jobs", type=int, default=1, help="targets at a time")
    parser.add_argument("--long", action="store_true", help="add the counts to those stored")
    parser.add_argument("--keep", action="store_true", help="what reaches further joins the corpus")
    options = parser.parse_args(words)
    names = [options.target] if options.target else [*TARGETS]
    each = partial(fuzz, seconds=options.seconds * options.jobs / len(names), seed=options.seed)
    results = {}
    with ProcessPoolExecutor(options.jobs) as pool:
        started = {pool.submit(each, name): name for name in names}
        for done in as_completed(started):
            name, result = started[done], done.result()
            run, found = TARGETS[name].run, result.faults.items()
            result.faults = {where: shortest(run, data) for where, data in found}
            results[name] = result
            told = f"{result.executions:,} runs, {result.size:,} bytes, {result.reached} reached"
            print(f"{name}: {told}, {len(result.kept)} kept", flush=True)
            for where, data in result.faults.items():
                print(f"  {where}\n  {data!r}", flush=True)
            if options.keep:
                keep(name, result.kept)
            if options.long:
                add(RESULT, {name: result})
    return 1 if any(result.faults for result in results.values()) else 0
