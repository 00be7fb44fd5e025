"""Build the stand-in `libcudart` and `libcuda` with the system's C compiler, once a version."""

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from splatbus_conformance.data import cache_folder

HERE = Path(__file__).parent
SOURCES = ("objects.c", "cudart.c", "events.c", "driver.c")
HEADERS = ("objects.h", "runtime.h")
SONAMES = ("libcudart.so.11.0", "libcudart.so.12", "libcudart.so.13")
"""What programs of CUDA 11, 12 and 13 ask for; they want the symbols in a version of that name."""
DRIVER = "libcuda.so.1"
COMPILE = ("-std=c11", "-O2", "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-c")
LINK = ("-shared", "-pthread", "-ldl")
COMPILER_SECONDS = 120.0


class NotAvailable(Exception):  # noqa: N818 - a finding, no error of ours
    """The stand-in cannot be had on this machine; the message says why, and what to install."""


def library_folder() -> Path:
    """The folder with `libcudart.so` in all its names and `libcuda.so.1`, for LD_LIBRARY_PATH.

    Built if need be, in the user's cache, under a digest of the sources. Raises NotAvailable.
    """
    if sys.platform != "linux":
        raise NotAvailable(f"the stand-in CUDA runtime runs on Linux, and this is {sys.platform}")
    command = shlex.split(os.environ.get("CC", "")) or ["cc"]
    folder = cache_folder() / f"cudart-{_digest(command)}"
    if folder.is_dir():
        return folder
    if shutil.which(command[0]) is None:
        raise NotAvailable(
            f"the stand-in CUDA runtime needs a C compiler, and there is no {command[0]!r}: "
            "install one (Debian: apt install gcc libc6-dev), or name yours in the variable CC"
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(prefix="building-", dir=folder.parent))
    try:
        _build(command, building)
        building.rename(folder)
    except OSError:
        if not folder.is_dir():  # else somebody else was quicker, with the same result
            raise
    finally:
        shutil.rmtree(building, ignore_errors=True)
    return folder


def _digest(command: list[str]) -> str:
    parts = [(HERE / name).read_bytes() for name in (*SOURCES, *HEADERS)]
    parts.append(repr((command, COMPILE, LINK, SONAMES, DRIVER)).encode())
    return hashlib.blake2b(b"\0".join(parts), digest_size=8).hexdigest()


def _build(command: list[str], folder: Path) -> None:
    _run([*command, *COMPILE, *(str(HERE / name) for name in SOURCES)], folder)
    objects = {path.name for path in folder.glob("*.o")}
    for soname in SONAMES:
        _link(command, folder, objects - {"driver.o"}, soname, f"{soname} {{ global: cuda*;")
    _link(command, folder, objects, DRIVER, "{ global: cu[A-Z]*;")
    (folder / "libcudart.so").symlink_to(SONAMES[-1])


def _link(
    command: list[str], folder: Path, objects: Iterable[str], soname: str, exported: str
) -> None:
    script = folder / f"{soname}.map"
    script.write_text(f"{exported} local: *; }};\n", "utf-8")
    named = (f"-Wl,-soname,{soname}", f"-Wl,--version-script,{script.name}", "-o", soname)
    _run([*command, *sorted(objects), *LINK, *named], folder)


def _run(command: list[str], folder: Path) -> None:
    try:
        ran = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=COMPILER_SECONDS
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotAvailable(f"the stand-in CUDA runtime could not be compiled: {error}") from None
    if ran.returncode:
        raise NotAvailable(
            "the stand-in CUDA runtime could not be compiled: "
            f"{shlex.join(command)}\n{ran.stderr.strip()[-2000:]}"
        )
