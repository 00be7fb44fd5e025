"""The Pythons of this machine, and programs run by them."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

COMMANDS = ("splatbus-conformance", "splatbus-server", "splatbus-client")
SECONDS = 120.0
OUR_OWN = re.compile("PYTHON|VIRTUAL_ENV|PIP_CONSTRAINT|SPLATBUS")


def run(*command: str | Path, cwd: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    """What a program of another environment says, without the variables of this one."""
    kept = {k: v for k, v in os.environ.items() if not OUR_OWN.match(k)}
    return subprocess.run(
        command,
        cwd=cwd,
        env={**kept, "TMPDIR": str(cwd), **settings},  # where pip leaves its certificates
        capture_output=True,
        encoding="utf-8",
        timeout=SECONDS,
    )


@cache
def python(version: str) -> Path | None:
    """An interpreter of a version such as "3.12", if there is one on this machine."""
    for candidate in _candidates(version):
        asked = run(candidate, "-c", "import sys; print(*sys.version_info[:2])", cwd=Path.cwd())
        if asked.returncode == 0 and asked.stdout.split() == version.split("."):
            return candidate
    return None


def _candidates(version: str) -> Iterator[Path]:
    yield Path(sys.executable)
    if found := shutil.which(f"python{version}"):
        yield Path(found)
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    yield from sorted(pyenv.glob(f"versions/{version}.*/bin/python"))


def pip_of(environment: Path) -> tuple[str | Path, ...]:
    """Our pip, for a virtual environment that needs none of its own."""
    return sys.executable, "-m", "pip", "--python", scripts(environment) / "python"


def scripts(environment: Path) -> Path:
    """Where a virtual environment has its programs."""
    return environment / ("Scripts" if os.name == "nt" else "bin")


def program_of(environment: Path, command: str) -> str:
    found = shutil.which(command, path=str(scripts(environment)))
    assert found is not None
    return found
