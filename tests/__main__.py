"""Run all that must pass: linters, types, import rules, the specification, the tests, the selftest.

`python -m tests` runs every step, `python -m tests lint types` those that are named;
`python -m tests long` what takes hours (`long.py`).
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

if sys.version_info < (3, 11):  # noqa: UP036 - pip refuses these, but a checkout runs without it
    sys.exit(f"Python 3.11 or newer is needed, and this is {sys.version.split()[0]}")

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("schemas", "reference_server", "reference_client", "conformance", "tests", "benchmarks")
RENDERERS = (
    "schemas/splatbus_schemas",
    "schemas/splatbus_wire",
    "reference_server/splatbus_server",
    "reference_server/splatbus_renderer",
    "reference_server/splatbus_splats",
    "reference_client/splatbus_client",
    "reference_client/splatbus_viewer",
)
"""What runs where trained models live, which is Python 3.9 and later."""
PACKAGES = (
    *RENDERERS,
    "reference_client/blender/splatbus_blender",
    "conformance/splatbus_conformance",
    "conformance/site/splatbus_site",
)
PYTHON = (sys.executable, "-m")
STEPS = {
    "lint": (*PYTHON, "ruff", "check", *SOURCES),
    "format": (*PYTHON, "ruff", "format", "--check", *SOURCES),
    "types": (*PYTHON, "mypy", *PACKAGES),
    "win32": (
        *(*PYTHON, "mypy", "--platform", "win32", "--follow-imports", "silent"),
        *("--exclude", "selftest", *PACKAGES),  # which forks
    ),
    "darwin": (*PYTHON, "mypy", "--platform", "darwin", *PACKAGES),
    "python3.10": (  # mypy's oldest, for which NumPy's newest has no types
        *(*PYTHON, "mypy", "--python-version", "3.10", "--no-warn-return-any", *RENDERERS),
    ),
    "python3.9": (
        *(str(Path(sys.executable).with_name("vermin")), "--no-tips", "--eval-annotations"),
        *("--target=3.9-", "--violations", *RENDERERS),
    ),
    "imports": (str(Path(sys.executable).with_name("lint-imports")),),
    "prose": (*PYTHON, "splatbus_schemas.prose"),
    "tests": (
        *(*PYTHON, "pytest", "-n", "3", "--dist", "loadfile", "--no-loadscope-reorder"),
        *("--ignore", "tests/foreign"),
    ),
    "foreign": (
        *(*PYTHON, "pytest", "-n", "3", "--dist", "load", "--maxschedchunk", "1"),
        "tests/foreign",
    ),
    "selftest": (*PYTHON, "splatbus_conformance", "--plain", "selftest"),
    "machine": (
        *(*PYTHON, "splatbus_conformance", "--plain", "selftest", "--machine"),
        *("--count", "20", "--again", "tests/data/machine_mutants.json"),
    ),
}


def main(wanted: list[str]) -> int:
    """Run the steps named, or all, and stop at the first that fails."""
    if wanted[:1] == ["long"]:
        return run((*PYTHON, "tests.long", *wanted[1:]))
    if unknown := set(wanted) - set(STEPS):
        print(f"no such step: {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")
        return 2
    for name in wanted or STEPS:
        print(f"== {name}", flush=True)
        if status := run(STEPS[name]):
            print(f"== {name} failed", flush=True)
            return status
    if not wanted:
        return run((*PYTHON, "tests.long", "--behind"))
    return 0


def run(command: Sequence[str]) -> int:
    """Its exit status."""
    with tempfile.TemporaryDirectory(prefix="splatbus-bytecode-") as folder:
        environment = caching(dict(os.environ), folder)
        return subprocess.run(command, cwd=ROOT, env=environment).returncode


def caching(environment: dict[str, str], folder: str) -> dict[str, str]:
    """An environment whose many processes do not all compile the same modules.

    Where Python is told to write no bytecode, none is written here, but into this folder.
    """
    if environment.pop("PYTHONDONTWRITEBYTECODE", ""):
        environment["PYTHONPYCACHEPREFIX"] = folder
    return environment


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
