"""Our loop beside Atheris and Hypothesis: how far each reaches in the same time, and what it finds.

    python -m tests.fuzz.compare --seconds 60

Atheris is no dependency; without it, it is left out. How far an engine reached is measured
by replaying what it kept, alike for all; the figures go to `tests/results/fuzz_engines.json`.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from tests.fuzz import corpus, mutator
from tests.fuzz.loop import fuzz
from tests.fuzz.reach import Reach
from tests.fuzz.targets import TARGETS
from tests.simulation.run import ROOT, commit

RESULT = ROOT / "tests" / "results" / "fuzz_engines.json"
COMPARED = ("client-on-message", "server", "recorded")
MOST_BYTES = 4096


def ours(name: str, seconds: float, start: list[bytes]) -> tuple[int, list[bytes]]:
    """What our loop keeps of a target in a time, and how often it ran it."""
    with mock.patch.object(corpus, "seeds", return_value=start):
        result = fuzz(name, seconds=seconds)
    return result.executions, result.kept


def with_hypothesis(name: str, seconds: float, start: list[bytes]) -> tuple[int, list[bytes]]:
    """The same with Hypothesis, which has no feedback."""
    reach = Reach(TARGETS[name])
    for data in start:
        reach.run(data)
    kept: list[bytes] = []
    executions = 0
    end = time.monotonic() + seconds

    @settings(
        max_examples=10**9,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=[*HealthCheck],
    )
    @given(_edited(start))
    def run(data: bytes) -> None:
        nonlocal executions
        executions += 1
        if reach.run(data):
            kept.append(data)
        if time.monotonic() > end:
            raise KeyboardInterrupt

    with contextlib.suppress(KeyboardInterrupt):
        run()
    return executions, kept


def _edited(start: list[bytes]) -> st.SearchStrategy[bytes]:
    @st.composite
    def edited(draw: st.DrawFn) -> bytes:
        data = draw(st.sampled_from(start))
        for _ in range(draw(st.integers(1, 4))):
            at = draw(st.integers(0, len(data)))
            end = at + draw(st.integers(0, 12))
            new = draw(st.binary(max_size=8) | st.just(data[at:end] * 2))
            data = data[:at] + new + data[end:]
        return data

    return edited()


def with_atheris(name: str, seconds: float, start: list[bytes]) -> tuple[int, list[bytes]]:
    """The same with Atheris, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        begun, kept = Path(folder, "begun"), Path(folder, "kept")
        begun.mkdir()
        kept.mkdir()
        for number, data in enumerate(start):
            (begun / str(number)).write_bytes(data)
        known = [*mutator.TOKENS, *corpus.words(start)]
        dictionary = Path(folder, "words")
        dictionary.write_text("".join(f'"{_escaped(word)}"\n' for word in known))
        line = [sys.executable, "-m", "tests.fuzz.compare", "--atheris", name, str(kept)]
        line += [str(begun), f"-max_total_time={seconds:.0f}", f"-max_len={MOST_BYTES}"]
        line += [f"-dict={dictionary}", "-print_final_stats=1", "-detect_leaks=0", "-seed=1"]
        ended = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, errors="replace")
        told = [row for row in ended.stderr.splitlines() if "number_of_executed_units" in row]
        executions = int(told[-1].split()[-1]) if told else 0
        return executions, [path.read_bytes() for path in sorted(kept.iterdir())]


def _escaped(word: bytes) -> str:
    return "".join(chr(b) if 35 <= b < 127 and b != 92 else f"\\x{b:02x}" for b in word)


def run_atheris(name: str, words: list[str]) -> None:
    """Becomes a fuzzer of a target; what it counts is compiled into the modules again."""
    import atheris  # type: ignore[import-untyped,import-not-found,unused-ignore]

    with atheris.instrument_imports(include=[*TARGETS[name].packages]):
        for package in TARGETS[name].packages:
            for module in [each for each in sys.modules if each.split(".")[0] == package]:
                del sys.modules[module]
        for module in [each for each in sys.modules if each.startswith("tests.")]:
            del sys.modules[module]
        from tests.fuzz.targets import TARGETS as INSTRUMENTED

    atheris.Setup(["fuzz", *words], INSTRUMENTED[name].run)
    atheris.Fuzz()


ENGINES: dict[str, Callable[[str, float, list[bytes]], tuple[int, list[bytes]]]] = {
    "ours": ours,
    "hypothesis": with_hypothesis,
    "atheris": with_atheris,
}


def engines() -> Iterator[str]:
    """Those that are installed."""
    for name in ENGINES:
        if name != "atheris" or importlib.util.find_spec("atheris"):
            yield name


def measured(engine: str, name: str, seconds: float, start: list[bytes]) -> dict[str, int]:
    """How far an engine reaches, and how often it runs the target for that."""
    executions, kept = ENGINES[engine](name, seconds, start)
    reach = Reach(TARGETS[name])
    for data in (*start, *kept):
        with contextlib.suppress(Exception):
            reach.run(data)
    return {"executions": executions, "kept": len(kept), "reached": len(reach.known)}


def main(words: list[str]) -> None:
    """Compares them."""
    if words[:1] == ["--atheris"]:
        run_atheris(words[1], words[2:])
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args(words)
    told: dict[str, Any] = {"commit": commit(), "seconds": options.seconds, "reached": {}}
    for name in COMPARED:
        for kind, start in (("examples", corpus.seeds(name)), ("nothing", [b"{}"])):
            for engine in engines():
                row = measured(engine, name, options.seconds, start)
                told["reached"].setdefault(f"{name}, from {kind}", {})[engine] = row
                print(name, kind, engine, row, flush=True)
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(json.dumps(told, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
