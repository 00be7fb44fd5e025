"""Run all that needs a GPU: the tests, and the kernel under compute-sanitizer where that is there.

`python -m tests.gpu` ends with status 0 if all is well, 1 if not, 2 where there is no GPU.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from tests.gpu import why_not

ROOT = Path(__file__).parents[2]
PYTHON = (sys.executable, "-m")


def main() -> int:
    """Run each step, whatever became of those before it."""
    if reason := why_not():
        print(f"not run: {reason}")
        return 2
    steps = {"tests": (*PYTHON, "pytest", "tests/gpu", "-q")}
    sanitizer = shutil.which("compute-sanitizer")
    for tool in ("memcheck", "racecheck", "initcheck") if sanitizer else ():
        options = (sanitizer, "--tool", tool, "--error-exitcode", "1")
        steps[tool] = (*options, *PYTHON, "tests.gpu.exercise")
    if not sanitizer:
        print("compute-sanitizer is not installed: the kernel is not checked with it")
    failed = []
    for name, command in steps.items():
        print(f"== {name}", flush=True)
        if subprocess.run(command, cwd=ROOT).returncode:
            failed.append(name)
    print(f"failed: {', '.join(failed)}" if failed else "all is well")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
