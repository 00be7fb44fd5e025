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
import os
import platform
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._pictures import pyplot, save
from benchmarks.hostile.attacks import ATTACKS

RESULTS = Path(__file__).parents[1] / "results"
ATTACKERS = 3
TOKEN = "known to everybody here"
GOALS = {"frames": 0.9, "p99_ms": 5.0, "turns": 0.9, "mebibytes": 32.0}
LET_GO_SECONDS = 10.0
"""Until memory has to have gone back."""


class Talker:
    """A process that is told lines, and answers each."""

    def __init__(self, stack: ExitStack, module: str, *arguments: str) -> None:
        self._process = stack.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", f"benchmarks.hostile.{module}", *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        )
        stack.callback(self._process.kill)

    def say(self, line: str) -> None:
        assert self._process.stdin
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def hear(self) -> Any:
        assert self._process.stdout
        return json.loads(self._process.stdout.readline())

    def ask(self, line: str = "") -> Any:
        self.say(line)
        return self.hear()


def behaved(host: Talker, canary: Talker, seconds: float) -> dict[str, float]:
    """What the canary saw in so many seconds, and what the loop did."""
    before, seen, after = host.ask(), canary.ask(str(seconds)), host.ask()
    waits = seen["waits"] or [np.inf]
    return {
        "frames": seen["seen"] / seen["poses"],
        "p99_ms": float(np.percentile(waits, 99)),
        "turns": (after["turns"] - before["turns"]) / (after["seconds"] - before["seconds"]),
    }


def attacked(name: str, token: str, seconds: float, loop: str) -> dict[str, Any]:
    """One attack on a server of its own."""
    with ExitStack() as stack:
        host = Talker(stack, "host", loop, token)
        ports = [str(port) for port in host.hear()]
        canary = Talker(stack, "canary", *ports, token)
        canary.ask("1")
        before = host.ask()["bytes"]
        peace = behaved(host, canary, seconds)
        line = [sys.executable, "-m", "benchmarks.hostile.attacks", name, *ports, token]
        attackers = [
            stack.enter_context(subprocess.Popen([*line, str(seconds + 1.0)]))
            for _ in range(ATTACKERS)
        ]
        time.sleep(0.5)
        war = behaved(host, canary, seconds)
        for each in attackers:
            each.wait()
        ended = time.monotonic()
        while True:
            grown = (host.ask()["bytes"] - before) / (1 << 20)
            if grown <= GOALS["mebibytes"] or time.monotonic() > ended + LET_GO_SECONDS:
                break
            time.sleep(0.5)
        return {"peace": peace, "attacked": war, "mebibytes": grown}


def misses(found: dict[str, Any], loop: str) -> list[str]:
    """The goals that were not reached, for people."""
    peace, war = found["peace"], found["attacked"]
    told = []
    if war["frames"] < GOALS["frames"] * peace["frames"]:
        told.append("frames")
    if war["p99_ms"] > GOALS["p99_ms"]:
        told.append("p99")
    if loop == "numpy" and war["turns"] < GOALS["turns"] * peace["turns"]:
        told.append("turns")
    if found["mebibytes"] > GOALS["mebibytes"]:
        told.append("memory")
    return told


def picture(result: dict[str, Any], path: Path) -> None:
    """A row of dots for each attack, in three panels."""
    plt = pyplot()
    names = list(ATTACKS)[::-1]
    figure, axes = plt.subplots(1, 3, figsize=(12, 0.32 * len(names) + 1.6), sharey=True)
    for (case, found), shift, color in zip(
        result["cases"].items(), (0.15, -0.15), ("#1f6feb", "#d1242f"), strict=False
    ):
        rows = [names.index(name) + shift for name in found]
        for axis, values in zip(
            axes,
            (
                [it["attacked"]["frames"] / it["peace"]["frames"] for it in found.values()],
                [it["attacked"]["p99_ms"] for it in found.values()],
                [it["attacked"]["turns"] / it["peace"]["turns"] for it in found.values()],
            ),
            strict=True,
        ):
            axis.plot(values, rows, "o", color=color, label=case)
    for axis, title, goal in zip(
        axes,
        (
            "images, of those in peace",
            "round trip, p99 (ms)",
            "turns of the loop, likewise",
        ),
        (GOALS["frames"], GOALS["p99_ms"], GOALS["turns"]),
        strict=True,
    ):
        axis.axvline(goal, linestyle=":", color="grey")
        axis.set_title(title)
        axis.grid(axis="y", alpha=0.3)
    axes[0].set_xlim(0.0, 1.1)
    axes[1].set_xscale("log")
    axes[2].set_xlim(0.0, 1.2)
    axes[0].set_yticks(range(len(names)), [ATTACKS[name][0] for name in names])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="lower left", ncols=2)
    figure.suptitle("A client that behaves, beside three that do not; dotted: the goals")
    figure.tight_layout(rect=(0.0, 0.04, 1.0, 1.0))
    save(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks hostile", description=__doc__)
    parser.add_argument("--seconds", type=float, default=3.0, help="of each attack")
    parser.add_argument("--only", choices=ATTACKS, help="one attack; nothing is written")
    parser.add_argument("--python", action="store_true", help="a loop that keeps the lock")
    given = parser.parse_args()
    loop = "python" if given.python else "numpy"
    cases: dict[str, dict[str, Any]] = {"without a token": {}, "with a token": {}}
    for case, token in zip(cases, ("", TOKEN), strict=True):
        for name in [given.only] if given.only else ATTACKS:
            cases[case][name] = found = attacked(name, token, given.seconds, loop)
            peace, war = found["peace"], found["attacked"]
            print(
                f"{case}, {name}: frames {war['frames']:.2f} of {peace['frames']:.2f},"
                f" p99 {war['p99_ms']:.2f} ms of {peace['p99_ms']:.2f},"
                f" turns {war['turns']:.0f} of {peace['turns']:.0f},"
                f" {found['mebibytes']:+.1f} MiB; missed: {', '.join(misses(found, loop)) or '-'}",
                flush=True,
            )
    if given.only:
        return
    name = "hostile_python" if given.python else "hostile"
    result = {
        "command": f"python -m benchmarks hostile{' --python' if given.python else ''}",
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
        },
        "python": platform.python_version(),
        "attackers": ATTACKERS,
        "goals": GOALS,
        "cases": cases,
        "missed": {
            f"{case}, {attack}": missed
            for case, found in cases.items()
            for attack, it in found.items()
            if (missed := misses(it, loop))
        },
    }
    (RESULTS / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
    picture(result, RESULTS / f"{name}.png")


if __name__ == "__main__":
    main()
