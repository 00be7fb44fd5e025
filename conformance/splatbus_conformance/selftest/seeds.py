"""`splatbus-conformance selftest --seeds N`: does the verdict hang on what is drawn?"""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

from rich.console import Console

from splatbus_conformance.selftest.judge import FULL_RUN_SECONDS, REFERENCE, run_harness
from splatbus_conformance.selftest.processes import harnesses
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING

WORKERS = 4
Verdicts = Mapping[str, str]
"""By requirement and check."""


def judge_seeds(count: int, out: Console) -> int:
    """Run every check on each of the references with seeds 1 to `count`; 1 unless all agree."""
    same = True
    pool = ThreadPoolExecutor(WORKERS)
    try:
        runs = {
            name: [pool.submit(_verdicts, name, seed) for seed in range(1, count + 1)]
            for name in REFERENCE
        }
        for name, futures in runs.items():
            found = [future.result() for future in futures]
            strange = differences(found)
            same = same and not strange and all(found)
            told = "the same verdicts" if not strange else "; ".join(strange)
            out.print(f"{name}: {count} seeds, {len(found[0])} checks and rules: {told}")
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        harnesses.stop_all()
        pool.shutdown()
    return EXIT_CONFORMING if same else EXIT_NOT_CONFORMING


def differences(found: list[Verdicts]) -> list[str]:
    """Where two runs disagree, in words."""
    names = sorted(set().union(*found))
    by_name = {name: [each.get(name, "absent") for each in found] for name in names}
    return [
        f"{name}: {', '.join(f'{v} {verdicts.count(v)} times' for v in sorted(set(verdicts)))}"
        for name, verdicts in by_name.items()
        if len(set(verdicts)) > 1
    ]


def _verdicts(name: str, seed: int) -> Verdicts:
    side, axes = REFERENCE[name]
    report, _, last_words = run_harness(
        name, side, "", FULL_RUN_SECONDS, axes, ("--seed", str(seed))
    )
    if report is None:
        return {last_words: "no report"}
    return {
        f"{requirement['id']} {result['check']}": result["verdict"]
        for requirement in report["requirements"]
        for result in requirement["results"]
    }
