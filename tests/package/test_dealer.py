"""The test command deals its files to processes: what they leave behind is told, and ended."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.keeper import abandoned, segments
from tests.package.building import ROOT
from tests.waiting import eventually

if sys.platform != "linux":
    pytest.skip("it forks", allow_module_level=True)

LEAVES = """
import os, subprocess, sys, tempfile
from pathlib import Path

SLEEPS = [sys.executable, "-c", "import time; time.sleep(600)", {mark!r}]

def test_that_leaves_a_process():
    subprocess.Popen(SLEEPS, start_new_session=True)

def test_that_leaves_a_file():
    tempfile.mkstemp(prefix="forgotten")

def test_that_passes():
    print("nothing of this is seen")
"""
DIES = "import os\n\ndef test_that_dies():\n    os.abort()\n"
HANGS = """
import subprocess, sys, time

def test_that_hangs():
    subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)", {mark!r}])
    time.sleep(600)
"""


def dealt(folder: Path) -> subprocess.Popen[str]:
    line = [sys.executable, "-m", "pytest", "-q", "-p", "tests.dealer", "--deal", "2"]
    options = ["--rootdir", str(folder), "-c", str(ROOT / "pyproject.toml"), str(folder)]
    pipe = subprocess.PIPE
    return subprocess.Popen([*line, *options], cwd=ROOT, stdout=pipe, stderr=pipe, text=True)


def sleepers(mark: str) -> bool:
    """Whether a process runs that has this mark among its arguments."""
    lines = Path("/proc").glob("[0-9]*/cmdline")
    return subprocess.run(["grep", "-qsaF", mark, *lines], check=False).returncode == 0


def test_what_a_test_leaves_behind_fails_it_and_is_ended(tmp_path: Path) -> None:
    mark = f"left by {tmp_path}"
    (tmp_path / "test_leaves.py").write_text(LEAVES.format(mark=mark), "utf-8")
    (tmp_path / "test_dies.py").write_text(DIES, "utf-8")
    run = dealt(tmp_path)
    told, complaints = run.communicate(timeout=240)
    assert run.returncode == 1, told + complaints
    assert "it left processes behind" in told
    assert mark in told
    assert "it left files behind: forgotten" in told
    assert "its process ended with -6" in told
    assert "in test_that_dies" in complaints
    assert "2 passed" in told
    assert not sleepers(mark)


def test_memory_is_left_behind_once_nobody_has_it() -> None:
    before = segments()
    path = Path(f"/dev/shm/splatbus-beside-{os.getpid()}")
    with path.open("w") as file:
        held = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], stdin=file)
    try:
        assert path not in abandoned(before)
        held.kill()
        held.wait()
        assert path in abandoned(before)
    finally:
        held.kill()
        path.unlink()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_whoever_deals_is_ended_with_all_that_it_has_started(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = f"hangs in {tmp_path}"
    (tmp_path / "test_hangs.py").write_text(HANGS.format(mark=mark), "utf-8")
    monkeypatch.setenv("TMPDIR", str(there := tmp_path / "temporary"))
    there.mkdir()
    run = dealt(tmp_path)
    assert eventually(lambda: sleepers(mark), 120)
    assert any(there.iterdir())
    run.send_signal(number)
    run.communicate(timeout=120)
    assert eventually(lambda: not sleepers(mark), 60)
    assert eventually(lambda: not any(there.iterdir()), 60), "what its files were in"
