"""The clients for engines, built with one of the programs that use them, and what those answer."""

import fcntl
import os
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from hashlib import blake2b
from pathlib import Path

import pytest
from splatbus_conformance.data import cache_folder
from splatbus_schemas.prose import CHECKOUT

from tests.csharp.compiled import compiled

LANGUAGES = ("csharp", "cpp")
LIBCXX = "C++ with libc++"
"""The library of Apple, Android and Unreal; without sanitizers, which compiles in seconds."""
CPP = CHECKOUT / "reference_client" / "cpp"
SOURCES = {
    "Tests": "tests/vectors.cpp",
    "Viewer": "programs/viewer.cpp",
    "Adapter": "programs/adapter.cpp",
}
PROGRAMS = Path(__file__).with_name("programs.cpp")
"""All of them in one, which takes the name of one as its first argument."""
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
CHECKED = (
    *("-O1", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"),
    "--param=asan-instrumentation-with-call-threshold=0",  # or it compiles a fifth longer
)
"""A fault of memory or an undefined behaviour ends the program, which no test takes for a pass."""
Command = list[str]


def built(language: str, program: str, folder: Path, *, sanitized: bool = True) -> Command:
    """The command that starts it; skips where its compiler, or its library, is missing."""
    if language == "csharp":
        return ["mono", str(compiled(folder / f"{program}.exe", program))]
    if language == LIBCXX:
        if not list(Path("/usr").glob("lib/llvm-*/include/c++/v1/vector")):
            pytest.skip("libc++ is not installed")
        return [str(compiled_cpp(PROGRAMS, "clang++", ("-O0", "-stdlib=libc++"))), program]
    if sanitized:
        return [str(compiled_cpp(PROGRAMS)), program]
    return [str(compiled_cpp(CPP / SOURCES[program], options=("-O2",)))]


def language_of(program: Command) -> str:
    return "csharp" if program[0] == "mono" else "cpp"


def compiled_cpp(
    source: Path,
    compiler: str = "g++",
    options: Sequence[str] = CHECKED,
    libraries: Sequence[str] = (),
) -> Path:
    """A program of the C++ client; a warning is an error."""
    line = [compiler, "-std=c++17", *options, *WARNINGS, f"-I{CPP}", f"-I{CPP / 'include'}"]
    line += ["-pthread", str(source), *libraries]
    return kept(source.stem, line, [*texts(source.parent), *texts(CPP)])


def texts(folder: Path) -> list[Path]:
    """What of C++ is in there."""
    return sorted(each for each in folder.rglob("*") if each.suffix in (".cpp", ".hpp", ".h"))


def kept(name: str, line: Sequence[str], of: Iterable[Path], folder: Path | None = None) -> Path:
    """What this command line makes of these texts; skips where its compiler is missing.

    It lies in the user's cache, under a digest of both; empty after `-fsyntax-only`.
    """
    if not shutil.which(line[0]):
        pytest.skip(f"{line[0]} is not installed")
    digest = blake2b(repr(line).encode(), digest_size=8)
    for each in of:
        digest.update(each.read_bytes())
    cache = cache_folder().with_name("splatbus-engines")
    target = cache / f"{name}-{digest.hexdigest()}"
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / f"{target.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # of several who want it one builds it
        if not target.is_file():
            made = target.with_suffix(".new")
            made.touch()
            whole = [*line, "-o", str(made)]
            done = subprocess.run(whole, cwd=folder, capture_output=True, text=True, timeout=600)
            assert done.returncode == 0, done.stdout + done.stderr
            made.replace(target)
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
