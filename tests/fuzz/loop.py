"""The loop: mutate an input, run the target, keep what reaches further."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from tests.fuzz import corpus
from tests.fuzz.mutator import Mutator
from tests.fuzz.reach import Reach
from tests.fuzz.targets import TARGETS, Run

TRACED_EVERY = 4
"""Of what is run, so much is traced: that takes several times as long as to run it."""
RECENT = 20
"""Of the inputs kept, as many are mutated as often as all others together."""
MOST_FAULTS = 10


@dataclass
class Fuzzed:
    """What came of a target.

    Attributes:
        executions: how often it was run.
        size: of all inputs, bytes.
        reached: steps from line to line.
        seconds: that it took.
        kept: inputs that reached further, in their order; the seeds are not among them.
        faults: what was raised, and the shortest input that raises it, by where it was raised.
    """

    executions: int = 0
    size: int = 0
    reached: int = 0
    seconds: float = 0.0
    kept: list[bytes] = field(default_factory=list)
    faults: dict[str, bytes] = field(default_factory=dict)


def fuzz(
    name: str,
    *,
    seconds: float | None = None,
    executions: int | None = None,
    seed: int = 0,
    traces: bool = True,
    most_faults: int = MOST_FAULTS,
) -> Fuzzed:
    """Runs a target for a time, or so often; the same seed and number make the same inputs.

    Args:
        name: of the target.
        seconds: after which it ends.
        executions: after which it ends; all that a target begins with is run in any case.
        seed: of the mutations.
        traces: whether it is found out what reaches further, and kept. That takes ten times as
            long as to run what a target begins with.
        most_faults: after which it ends.
    """
    target, random = TARGETS[name], Random(f"{name} {seed}")
    reach, result = Reach(target), Fuzzed()
    began = time.monotonic()
    inputs = [*corpus.seeds(name), *corpus.found(name)]
    mutator = Mutator(random, corpus.words(inputs))
    for data in inputs:
        _try(reach.run if traces else target.run, data, result)
    number = 0
    while len(result.faults) < most_faults:
        if executions is not None and result.executions >= executions:
            break
        if seconds is not None and time.monotonic() - began >= seconds:
            break
        number += 1
        recent = inputs[-RECENT:] if random.random() < 0.5 else inputs
        data = mutator.mutated(random.choice(recent), inputs)
        if number % TRACED_EVERY or not traces:
            _try(target.run, data, result)
        elif _try(reach.run, data, result):
            inputs.append(data)
            result.kept.append(data)
    result.reached = len(reach.known)
    result.seconds = time.monotonic() - began
    return result


def _try(run: Callable[[bytes], object], data: bytes, result: Fuzzed) -> object:
    result.executions += 1
    result.size += len(data)
    try:
        return run(data)
    except Exception as error:
        result.faults.setdefault(where(error), data)
        return None


def where(error: BaseException) -> str:
    """What an error is, and where it was raised."""
    last = traceback.extract_tb(error.__traceback__, limit=-1)[0]
    return f"{type(error).__name__} in {last.name}: {last.line}"


def fault_of(run: Run, data: bytes) -> str | None:
    """Where it fails with this, None if it does not."""
    try:
        run(data)
    except Exception as error:
        return where(error)
    return None


def shortest(run: Run, data: bytes) -> bytes:
    """The input without all that can be left out so that it still fails as it does."""
    told, former = fault_of(run, data), b""
    while data != former:
        former, size = data, len(data)
        while size := size // 2:
            at = 0
            while at < len(data):
                shorter = data[:at] + data[at + size :]
                if fault_of(run, shorter) == told:
                    data = shorter
                else:
                    at += size
    return data
