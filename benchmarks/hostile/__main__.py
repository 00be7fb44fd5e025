"""What can three attackers take from a client that behaves, and from the render loop beside it?

A server renders in its own process; a canary sends 40 poses a second, sees each in an image, and
pings. Beside that, three processes attack at once, each in the same way, for some seconds. Before
each attack the same is measured in peace: that is its floor. Without a token, and with one that the
attackers know.

    python -m benchmarks hostile [--seconds 3] [--only NAME] [--python]

writes `benchmarks/results/hostile.json` and `hostile.png`. With `--python` the render loop never
lets go of the interpreter's lock.
"""

from __future__ import annotations

import argparse
import json
import time
from contextlib import ExitStack
from typing import Any

import numpy as np

from benchmarks import _shared
from benchmarks.hostile.attacks import ATTACKS

ATTACKERS = 3
TOKEN = "known to everybody here"
GOALS = {"frames": 0.9, "p99_ms": 5.0, "turns": 0.9, "mebibytes": 32.0}
LET_GO_SECONDS = 10.0
"""Until memory has to have gone back."""


def ask(process: _shared.Child, line: object = "") -> Any:
    """What a process answers to a line."""
    assert process.stdin
    process.stdin.write(f"{line}\n")
    process.stdin.flush()
    return json.loads(_shared.heard(process))


def behaved(host: Any, canary: Any, seconds: float) -> dict[str, float]:
    """What the canary saw in so many seconds, and what the loop did."""
    before, seen, after = ask(host), ask(canary, seconds), ask(host)
    waits = seen["waits"] or [1e3 * seconds]
    return {
        "frames": seen["seen"] / seen["poses"],
        "p99_ms": float(np.percentile(waits, 99)),
        "turns": (after["turns"] - before["turns"]) / (after["seconds"] - before["seconds"]),
    }


def attacked(name: str, token: str, seconds: float, loop: str) -> dict[str, Any]:
    """One attack on a server of its own."""

    def running(module: str, *arguments: object) -> Any:
        return stack.enter_context(_shared.calling(f"hostile.{module}", "main", *arguments))

    with ExitStack() as stack:
        host = running("host", loop, token)
        ports = json.loads(_shared.heard(host))
        canary = running("canary", *ports, token)
        ask(canary, 1)
        before = ask(host)["bytes"]
        peace = behaved(host, canary, seconds)
        line = (name, *ports, token, seconds + 1.0)
        attackers = [running("attacks", *line) for _ in range(ATTACKERS)]
        time.sleep(0.5)
        war = behaved(host, canary, seconds)
        for each in attackers:
            each.wait()
        ended = time.monotonic()
        while True:
            grown = (ask(host)["bytes"] - before) / (1 << 20)
            if grown <= GOALS["mebibytes"] or time.monotonic() > ended + LET_GO_SECONDS:
                return {"peace": peace, "attacked": war, "mebibytes": grown}
            time.sleep(0.5)


def misses(found: dict[str, Any], loop: str) -> list[str]:
    """The goals that were not reached, for people."""
    peace, war = found["peace"], found["attacked"]
    is_missed = {
        "frames": war["frames"] < GOALS["frames"] * peace["frames"],
        "p99": war["p99_ms"] > GOALS["p99_ms"],
        "turns": loop == "numpy" and war["turns"] < GOALS["turns"] * peace["turns"],
        "memory": found["mebibytes"] > GOALS["mebibytes"],
    }
    return [name for name, missed in is_missed.items() if missed]


def picture(cases: dict[str, dict[str, Any]], name: str) -> None:
    """A row of dots for each attack, in three panels."""
    names = list(ATTACKS)[::-1]
    figure, axes = _shared.panels(1, 3, figsize=(12, 0.32 * len(names) + 1.6), sharey=True)
    titles = {
        "frames": "images, of those in peace",
        "p99_ms": "round trip, p99 (ms)",
        "turns": "turns of the loop, likewise",
    }
    for axis, (key, title) in zip(axes, titles.items(), strict=True):
        for case, found in cases.items():
            values = [
                it["attacked"][key] / (1.0 if key == "p99_ms" else it["peace"][key])
                for it in found.values()
            ]
            axis.plot(values, [names.index(each) for each in found], "o", alpha=0.6, label=case)
        axis.axvline(GOALS[key], linestyle=":", color="grey", label="goal")
        axis.set(title=title, xscale="log" if key == "p99_ms" else "linear")
        axis.grid(axis="y", alpha=0.3)
    axes[0].set_yticks(range(len(names)), [ATTACKS[each][0] for each in names])
    axes[0].legend(fontsize=8)
    _shared.save(figure, name)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks hostile", description=__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each attack")
    parser.add_argument("--only", choices=ATTACKS, help="one attack; nothing is written")
    parser.add_argument("--python", action="store_true", help="a loop that keeps the lock")
    given = parser.parse_args()
    loop = "python" if given.python else "numpy"
    cases: dict[str, dict[str, Any]] = {"without a token": {}, "with a token": {}}
    missing: dict[str, list[str]] = {}
    for case, token in zip(cases, ("", TOKEN), strict=True):
        for name in [given.only] if given.only else ATTACKS:
            cases[case][name] = found = attacked(name, token, given.seconds, loop)
            missed = misses(found, loop)
            _shared.told({"case": case, "attack": name, **found, "missed": missed})
            if missed:
                missing[f"{case}, {name}"] = missed
    if given.only:
        return
    name = "hostile_python" if given.python else "hostile"
    report = {"attackers": ATTACKERS, "goals": GOALS, "cases": cases, "missed": missing}
    _shared.write("hostile", report, name)
    picture(cases, name)


if __name__ == "__main__":
    main()
