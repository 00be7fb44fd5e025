"""Measure: `python -m benchmarks` runs every benchmark, `python -m benchmarks NAME` one of them.

Each writes its figures, its command, and a picture to `benchmarks/results/`.
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> int:
    modules = [path.stem for path in HERE.glob("*.py") if path.stem[0] != "_"]
    names = sorted([*modules, *(path.parent.name for path in HERE.glob("*/__main__.py"))])
    name, *options = sys.argv[1:] or [""]
    if name and name not in names:
        print(__doc__, f"benchmarks: {', '.join(names)}", sep="\n")
        return 2
    for each in [name] if name else names:
        print(f"== {each}", flush=True)
        command = [sys.executable, "-m", f"benchmarks.{each}", *options]
        if status := subprocess.run(command, cwd=HERE.parent).returncode:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main())
