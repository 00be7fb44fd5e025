"""The clients for engines, built with one of the programs that use them, and what those answer."""

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
from splatbus_schemas.prose import CHECKOUT

from tests.csharp.compiled import compiled

LANGUAGES = ("csharp", "cpp")
CPP = CHECKOUT / "reference_client" / "cpp"
SOURCES = {
    "Tests": "tests/vectors.cpp",
    "Viewer": "programs/viewer.cpp",
    "Adapter": "programs/adapter.cpp",
}
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
CHECKED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""A fault of memory or an undefined behaviour ends the program, which no test takes for a pass."""
Command = list[str]


def built(language: str, program: str, folder: Path, *, sanitized: bool = True) -> Command:
    """The command that starts it; skips where its compiler is missing."""
    if language == "csharp":
        return ["mono", str(compiled(folder / f"{program}.exe", program))]
    options = CHECKED if sanitized else ("-O2",)
    return [str(compiled_cpp(folder / program, SOURCES[program], options=options))]


def compiled_cpp(
    target: Path,
    source: str,
    compiler: str = "g++",
    options: Sequence[str] = CHECKED,
    libraries: Sequence[str] = (),
) -> Path:
    """A program of the C++ client; a warning is an error."""
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed")
    line = [compiler, "-std=c++17", *options, *WARNINGS, f"-I{CPP / 'include'}", "-pthread"]
    line += [str(CPP / source), "-o", str(target), *libraries]
    done = subprocess.run(line, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def answers(
    program: Command, payloads: Sequence[bytes], variables: Mapping[str, str] | None = None
) -> list[str]:
    """To each payload `taken …`, or `refused: ` and why."""
    done = subprocess.run(
        program,
        env={**os.environ, **(variables or {})},
        input="".join(f"{each.hex()}\n" for each in payloads),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert len(told) == len(payloads)
    return told
