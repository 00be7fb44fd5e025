"""Compiles the assemblies of the Unity package, and whatever uses them."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.csharp.unity_stub.metas import PACKAGE, sources

STUB = Path(__file__).parent
UNITY = PACKAGE / "unity"


def mcs(target: Path, *arguments: str | Path) -> Path:
    for command in ("mcs", "mono"):
        if not shutil.which(command):
            pytest.skip(f"{command} is not installed")
    line = ["mcs", "-warn:4", "-warnaserror", "-unsafe", "-langversion:7", f"-out:{target}"]
    line += ["-r:System.Numerics.dll", *(str(each) for each in arguments)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def asmdefs() -> dict[str, tuple[Path, dict[str, Any]]]:
    """By the name of the assembly: its folder, and what its file says."""
    read = {each: json.loads(each.read_text("utf-8")) for each in PACKAGE.rglob("*.asmdef")}
    return {said["name"]: (path.parent, said) for path, said in read.items()}


def sources_of(folder: Path) -> list[Path]:
    """As Unity has it: all below, but for what belongs to an assembly further down."""
    inner = [each for each, _ in asmdefs().values() if each != folder and folder in each.parents]
    return [each for each in sources(folder) if not any(one in each.parents for one in inner)]


def refers_to(said: dict[str, Any]) -> set[str]:
    """Assemblies of ours that it names; others are Unity's own."""
    named = set(said.get("references", ()))
    theirs = {"Unity.RenderPipelines.Core.Runtime", "Unity.RenderPipelines.Universal.Runtime"}
    assert named - theirs <= asmdefs().keys()
    return named - theirs
