"""Measure: `python -m benchmarks` runs every benchmark, `python -m benchmarks NAME` one of them.

Each writes its figures, its command, and a picture to `benchmarks/results/`.
"""

import subprocess
import sys
from pathlib import Path


def main() -> int:
    names = sorted(p.stem for p in Path(__file__).parent.glob("*.py") if p.stem[0] != "_")
    name, *options = sys.argv[1:] or [""]
    if name and name not in names:
        print(__doc__, f"benchmarks: {', '.join(names)}", sep="\n")
        return 2
    for each in [name] if name else names:
        print(f"== {each}", flush=True)
        command = [sys.executable, "-m", f"benchmarks.{each}", *options]
        if status := subprocess.run(command, cwd=Path(__file__).parents[1]).returncode:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
