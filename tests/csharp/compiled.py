"""The C# client, compiled with one of the programs that use it."""

import shutil
import subprocess
from pathlib import Path

import pytest
from splatbus_schemas.prose import CHECKOUT

from tests.csharp.unity_stub import metas

FOLDER = CHECKOUT / "reference_client" / "csharp"


def compiled(target: Path, program: str = "Tests") -> Path:
    """`SplatBus.` and this program, written there; skips where Mono is missing."""
    for command in ("mcs", "mono"):
        if not shutil.which(command):
            pytest.skip(f"{command} is not installed")
    sources = [str(each) for each in metas.sources(FOLDER / "SplatBus.Client")]
    sources += [str(each) for each in sorted(FOLDER.glob(f"SplatBus.{program}~/*.cs"))]
    line = ["mcs", "-warn:4", "-warnaserror", "-unsafe", "-langversion:7"]
    line += ["-r:System.Numerics.dll", f"-out:{target}", *sources]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return target
