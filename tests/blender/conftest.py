"""The extension as it is built."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.blender.running import ROOT


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built")
    line = [sys.executable, str(ROOT / "reference_client/blender/build.py"), str(folder)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.splitlines()[-1])
