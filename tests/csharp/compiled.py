"""The C# client, compiled with one of the programs that use it, and what those answer."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from splatbus_schemas.prose import CHECKOUT

FOLDER = CHECKOUT / "reference_client" / "csharp"


def compiled(target: Path, program: str = "Tests") -> Path:
    """`SplatBus.` and this program, written there; skips where Mono is missing."""
    for command in ("mcs", "mono"):
        if not shutil.which(command):
            pytest.skip(f"{command} is not installed")
    sources = [str(each) for each in sorted(FOLDER.glob("SplatBus.Client/*.cs"))]
    sources += [str(each) for each in sorted(FOLDER.glob(f"SplatBus.{program}/*.cs"))]
    line = ["mcs", "-warn:4", "-warnaserror", "-unsafe", "-langversion:7"]
    line += ["-r:System.Numerics.dll", f"-out:{target}", *sources]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def answers(program: Path, payloads: Sequence[bytes]) -> list[str]:
    """To each payload `taken …`, or `refused: ` and why."""
    done = subprocess.run(
        ["mono", str(program)],
        input="".join(f"{each.hex()}\n" for each in payloads),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert len(told) == len(payloads)
    return told
