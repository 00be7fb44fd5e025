"""The clients for engines, built with one of the programs that use them, and what those answer."""

import fcntl
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import Path

import pytest
from splatbus_conformance.data import cache_folder
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
CHECKED = ("-O1", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""A fault of memory or an undefined behaviour ends the program, which no test takes for a pass."""
Command = list[str]


def built(language: str, program: str, folder: Path, *, sanitized: bool = True) -> Command:
    """The command that starts it; skips where its compiler is missing."""
    if language == "csharp":
        return ["mono", str(compiled(folder / f"{program}.exe", program))]
    return [str(compiled_cpp(SOURCES[program], options=CHECKED if sanitized else ("-O2",)))]


def compiled_cpp(
    source: str,
    compiler: str = "g++",
    options: Sequence[str] = CHECKED,
    libraries: Sequence[str] = (),
) -> Path:
    """A program of the C++ client; a warning is an error.

    It lies in the user's cache, under a digest of all that it is made of.
    """
    if not shutil.which(compiler):
        pytest.skip(f"{compiler} is not installed")
    line = [compiler, "-std=c++17", *options, *WARNINGS, f"-I{CPP / 'include'}", "-pthread"]
    line += [str(CPP / source), *libraries]
    texts = sorted(each for each in CPP.rglob("*") if each.suffix in (".cpp", ".hpp"))
    digest = blake2b(repr(line).encode(), digest_size=8)
    for each in texts:
        digest.update(each.read_bytes())
    cache = cache_folder().with_name("splatbus-engines")
    program = cache / f"{Path(source).stem}-{digest.hexdigest()}"
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / f"{program.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # of several who want it one builds it
        if not program.is_file():
            made = program.with_suffix(".new")
            done = subprocess.run(
                [*line, "-o", str(made)], capture_output=True, text=True, timeout=600
            )
            assert done.returncode == 0, done.stdout + done.stderr
            made.replace(program)
    return program


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
