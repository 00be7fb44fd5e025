"""Sources to build from, in folders of their own, and what is built from them."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILD_SECONDS = 120.0


def tracked() -> list[str]:
    """The files of this checkout that git knows; skips the test where git knows none."""
    if not (ROOT / ".git").exists():
        pytest.skip("git says what belongs to the sources, and this is no checkout of it")
    listed = subprocess.run(
        ("git", "ls-files", "-z"), cwd=ROOT, capture_output=True, check=True, encoding="utf-8"
    ).stdout.split("\0")
    return sorted(name for name in listed if (ROOT / name).is_file())


def copy(names: list[str], folder: Path) -> Path:
    """A copy of these files of the checkout, as a fresh clone has them."""
    for name in names:
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, target)
        target.chmod(0o755 if os.access(ROOT / name, os.X_OK) else 0o644)
    return folder


def build(sources: Path, out: Path, **settings: str) -> tuple[Path, Path]:
    """The wheel and the sdist built from these sources, by a process with these variables."""
    kept = {k: v for k, v in os.environ.items() if k != "SOURCE_DATE_EPOCH"}
    options = ("--no-isolation", "--wheel", "--sdist", "--outdir", out)
    done = subprocess.run(
        (sys.executable, "-m", "build", *options, sources),
        env={**kept, **settings},
        capture_output=True,
        text=True,
        timeout=BUILD_SECONDS,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,), (sdist,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, sdist


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
