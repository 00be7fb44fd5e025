"""`python -m tests.baseline`: what the harness says of the reference pair and of all recordings.

A redesign of the judge has to say the same: `--store` writes it, and without that what differs is
printed. What kills each mutant is in `conformance/KILL_MATRIX.md`, what each foreign program is
held to in its `program.toml`.
"""

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.long import PAIR, PROFILES, REPORT, ROOT, judging_own

STORED = ROOT / "tests" / "results" / "baseline.json"
RECORDED = ("recordings/*.jsonl", "captures/*.pcap*")
SEEDS = range(3)
Said = dict[str, Any]


def main() -> int:
    """1 if the harness says something else than what is stored."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--store", action="store_true", help="keep what it says now")
    parser.add_argument("--profile", choices=PROFILES, nargs="+", default=PROFILES)
    options = parser.parse_args()
    if not (options.store or STORED.is_file()):
        parser.error("nothing is stored to compare with: --store keeps what it says now")
    said = dict(sorted((*audits(), *runs(options.profile))))
    if options.store:
        STORED.write_text(json.dumps(said, indent=1, ensure_ascii=False) + "\n", "utf-8")
        return 0
    before = json.loads(STORED.read_text("utf-8"))
    lines = [line for name in said for line in differences(name, before.get(name, {}), said[name])]
    print(*lines, sep="\n")
    return bool(lines)


def audits() -> Iterator[tuple[str, Said]]:
    """Of every recording, what each side is seen to keep and to break, and how often."""
    data = ROOT / "tests" / "data"
    for path in sorted(itertools.chain(*map(data.glob, RECORDED))):
        with tempfile.TemporaryDirectory() as folder:
            line = [sys.executable, "-m", "splatbus_conformance", "--plain", "audit", str(path)]
            subprocess.run([*line, "--json", str(Path(folder, REPORT))], capture_output=True)
            for each in json.loads(Path(folder, REPORT).read_text("utf-8")):
                yield f"audit of {path.name}, {each['side']}", summary(each, "text")


def runs(profiles: Sequence[str]) -> Iterator[tuple[str, Said]]:
    """Of the pair, which verdict each requirement has."""
    todo = list(itertools.product(PAIR, profiles, SEEDS))
    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(lambda it: run(*it), todo)


def run(name: str, profile: str, seed: int) -> tuple[str, Said]:
    """One of them."""
    with tempfile.TemporaryDirectory() as folder:
        judging_own(name, profile, seed, Path(folder))
        report = json.loads(Path(folder, REPORT).read_text("utf-8"))
    return f"{name}, {profile}, seed {seed}", summary(report, "code")


def summary(report: Said, shown: str) -> Said:
    """The verdict of each requirement that has one, with the codes or texts of its results."""
    return {
        it["id"]: ": ".join(
            [it["verdict"], *sorted({each[shown] for each in it["results"]} - {""})]
        )
        for it in report["requirements"]
        if it["verdict"] != "skip"
    }


def differences(name: str, before: Said, now: Said) -> list[str]:
    """What is said otherwise, a line each."""
    ids = sorted({*before, *now})
    pairs = [(each, before.get(each, "nothing"), now.get(each, "nothing")) for each in ids]
    return [f"{name}: {each}: {had}, now {has}" for each, had, has in pairs if had != has]


if __name__ == "__main__":
    sys.exit(main())
