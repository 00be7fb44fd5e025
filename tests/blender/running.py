"""Programs under a Python that has Blender as a module, `bpy`, which is not this one."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAMS = Path(__file__).parent / "programs"
VARIABLE = "SPLATBUS_BLENDER_PYTHON"
_PACKAGES = ("schemas", "reference_client", "reference_client/blender", "tests/blender/programs")


def python() -> str:
    """The Python that the environment names; without it, the test is skipped."""
    if not (named := os.environ.get(VARIABLE)):
        pytest.skip(f"needs Blender: {VARIABLE} has to name a Python that can import bpy")
    return named


def environment(home: Path, **more: str) -> dict[str, str]:
    """What such a Python is started with: this checkout, and nobody's settings of Blender."""
    (info := home / "packages" / "splatbus_protocol-0.dist-info").mkdir(parents=True, exist_ok=True)
    # The client says its version, and nothing of it is installed there.
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: splatbus-protocol\nVersion: 0\n")
    paths = [str(info.parent), *(str(ROOT / each) for each in _PACKAGES)]
    ours = {"PYTHONPATH": os.pathsep.join(paths), "BLENDER_USER_RESOURCES": str(home)}
    return os.environ | ours | more


def adapter(interpreter: str, home: Path) -> tuple[str, ...]:
    """How the harness judges the extension in a Blender, which takes long to import."""
    ours = environment(home)
    given = [f"{name}={ours[name]}" for name in ("PYTHONPATH", "BLENDER_USER_RESOURCES")]
    answers = "import bpy; from splatbus_blender.adapter import main; main()"
    command = shlex.join(["env", *given, interpreter, "-c", answers])
    return "--adapter", command, "--patience", "60"


def ran(program: str, home: Path, *arguments: str, **more: str) -> str:
    """What a program has printed, and Blender logged; it has to end well."""
    line = [python(), str(PROGRAMS / program), *arguments]
    done = subprocess.run(
        line, env=environment(home, **more), capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, f"{done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr
