"""Does anything grow that should not, in twenty minutes of clients that come, go and misbehave?

    python -m benchmarks.hostile.soak [--minutes 20]

A server renders; a canary behaves; every attack has its turn for some seconds, again and again.
What the server's process has is looked at after each round of them, in peace, and written to
`benchmarks/results/soak.json` and `soak.png`.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from benchmarks._pictures import pyplot, save
from benchmarks.hostile.__main__ import RESULTS, Talker
from benchmarks.hostile.attacks import ATTACKS

COUNTED = ("bytes", "files", "threads", "segments", "shared_bytes")
TURN_SECONDS = 1.0
REST_SECONDS = 12.0
"""Until all that was done for an attack has to be over."""
FLAT_BYTES = 4 << 20


def rounds(minutes: float) -> list[dict[str, float]]:
    """What the process had after each round."""
    found = []
    until = time.monotonic() + 60.0 * minutes
    with ExitStack() as stack:
        host = Talker(stack, "host", "numpy", "")
        ports = [str(port) for port in host.hear()]
        canary = Talker(stack, "canary", *ports, "")
        while time.monotonic() < until:
            for name in ATTACKS:
                line = [sys.executable, "-m", "benchmarks.hostile.attacks", name, *ports, ""]
                with subprocess.Popen([*line, str(TURN_SECONDS)]):
                    canary.ask(str(TURN_SECONDS))
            time.sleep(REST_SECONDS)
            told = host.ask()
            found.append({name: told[name] for name in ("seconds", *COUNTED)})
            counted = ", ".join(f"{name} {told[name]:,}" for name in COUNTED)
            print(f"{len(found)}: {counted}", flush=True)
    return found


def grown(found: list[dict[str, float]]) -> list[str]:
    """What is more at the end than after a third of the time, for people."""
    begin, end = found[len(found) // 3], found[-1]
    allowed = dict.fromkeys(COUNTED, 0) | {"bytes": FLAT_BYTES}
    return [name for name in COUNTED if end[name] > begin[name] + allowed[name]]


def picture(found: list[dict[str, float]], path: Path) -> None:
    """A panel for each."""
    plt = pyplot()
    figure, axes = plt.subplots(1, len(COUNTED), figsize=(14, 2.8))
    minutes = [(it["seconds"] - found[0]["seconds"]) / 60 for it in found]
    for axis, name in zip(axes, COUNTED, strict=True):
        unit = 1 << 20 if "bytes" in name else 1
        axis.plot(minutes, [it[name] / unit for it in found])
        axis.set_ylim(bottom=0)
        axis.set_title(name.replace("bytes", "MiB").replace("_", " "))
        axis.set_xlabel("minutes")
    figure.tight_layout()
    save(figure, path)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hostile.soak", description=__doc__)
    parser.add_argument("--minutes", type=float, default=20.0)
    given = parser.parse_args()
    found = rounds(given.minutes)
    result = {
        "command": f"python -m benchmarks.hostile.soak --minutes {given.minutes:g}",
        "python": platform.python_version(),
        "grown": grown(found),
        "rounds": found,
    }
    (RESULTS / "soak.json").write_text(json.dumps(result, indent=1) + "\n")
    picture(found, RESULTS / "soak.png")
    print(f"grown: {', '.join(result['grown']) or 'nothing'}")
    return 1 if result["grown"] else 0


if __name__ == "__main__":
    sys.exit(main())
