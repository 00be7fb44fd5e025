"""Blender as a Python module, in the versions that the extension is tried in.

Puts each into the user's cache, or those that are named, and says where its Python is. They are
wheels of the package index, some hundred megabytes each.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock

from splatbus_conformance.data import cache_folder

from tests.blender.running import ROOT, VARIABLE
from tests.foreign.programs import Lacking
from tests.package.pythons import python

BLENDERS = {"4.2": "3.11", "4.5": "3.11", "5.0": "3.11"}
"""Both LTS and the newest, and the Python that each is made for."""
_INSTALL_SECONDS = 1800
_TEST_SECONDS = 3600
_installing = Lock()


def installed(version: str) -> str:
    """The Python that can import this Blender.

    Raises:
        Lacking: it is not in the cache, and cannot be had.
    """
    cache = cache_folder().with_name("splatbus-blender")
    place = cache / f"bpy-{version}"
    with _installing:
        if not place.is_dir():
            cache.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=cache) as scratch:
                _install(version, made := Path(scratch) / place.name)
                made.replace(place)  # whole, or not at all
    return str(place / "bin" / "python")


def tried(version: str, scratch: Path) -> list[str]:
    """What is wrong by the tests of the extension.

    Raises:
        Lacking: there is no such Blender.
    """
    words = ("tests/blender", "--ignore", "tests/blender/test_adapter.py")
    return passing(words, os.environ | {VARIABLE: installed(version)}, scratch)


def passing(words: Sequence[str], variables: Mapping[str, str], scratch: Path) -> list[str]:
    """What is wrong by these tests, of which none may be skipped."""
    line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs", *words]
    done = subprocess.run(
        [*line, f"--basetemp={scratch / 'tests'}"],
        cwd=ROOT,
        env=variables,
        capture_output=True,
        text=True,
        timeout=_TEST_SECONDS,
    )
    told = (done.stderr + done.stdout)[-1000:]
    return [told] if done.returncode or " skipped" in told else []


def _install(version: str, place: Path) -> None:
    if (base := python(BLENDERS[version])) is None:
        raise Lacking(f"Blender {version} needs Python {BLENDERS[version]}")
    own = str(place / "bin" / "python")
    for line in (
        [str(base), "-m", "venv", str(place)],
        [own, "-m", "pip", "install", "--quiet", f"bpy=={version}.*"],
        [own, "-c", "import bpy"],
    ):
        done = subprocess.run(line, capture_output=True, text=True, timeout=_INSTALL_SECONDS)
        if done.returncode:
            raise Lacking(f"Blender {version} cannot be had: {done.stderr[-400:]}")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser("python -m tests.blender.blenders", description=__doc__)
    parser.add_argument("version", nargs="*", choices=BLENDERS)
    for each in parser.parse_args(arguments).version or BLENDERS:
        print(installed(each))


if __name__ == "__main__":
    main()
