"""The extension in the window of Debian's Blender 3.4, on a virtual display, in a garden."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from tests.blender.running import PROGRAMS, environment
from tests.splats.served import serving_garden

WIDTH, HEIGHT = 1120, 700
GAUSSIANS = 250_000
SHOWN = ("COMPOSITE", "DEPTH")
"""The looks whose screenshots the guide shows."""
NEEDS = "needs Blender 3.4 and a display: apt-get install blender xvfb python3-numpy"
_RUN_SECONDS = 900


@cache
def is_there() -> bool:
    """Whether this machine has that Blender, and what shows its window to nobody."""
    if not shutil.which("blender") or not shutil.which("xvfb-run"):
        return False
    return (
        subprocess.run(["blender", "--version"], capture_output=True).stdout[:11] == b"Blender 3.4"
    )


@contextmanager
def garden() -> Iterator[dict[str, str]]:
    """`splatbus-server garden.ply`, and where it is."""
    with serving_garden(GAUSSIANS) as server:
        ipc, message = server.ports
        yield {"SPLATBUS_IPC_PORT": f"{ipc}", "SPLATBUS_MSG_PORT": f"{message}"}


def screenshots(home: Path) -> Path:
    """The folder that `programs/window.py` has filled; skips where there is no such Blender."""
    if not is_there():
        pytest.skip(NEEDS)
    (folder := home / "window").mkdir()
    line = ["xvfb-run", "--auto-servernum", "--server-args", f"-screen 0 {WIDTH}x{HEIGHT}x24"]
    line += ["blender", "--factory-startup", "--window-geometry", "0", "0", f"{WIDTH}", f"{HEIGHT}"]
    line += ["--python-use-system-env", "--python-exit-code", "1"]
    line += ["--python", str(PROGRAMS / "window.py"), "--", str(folder), *SHOWN]
    with garden() as where:
        ours = environment(home, **where, LIBGL_ALWAYS_SOFTWARE="1", TMPDIR=str(home))
        pipe = subprocess.PIPE
        with subprocess.Popen(
            line, env=ours, stdout=pipe, stderr=pipe, text=True, start_new_session=True
        ) as started:
            try:
                told = "".join(started.communicate(timeout=_RUN_SECONDS))
            finally:
                if started.poll() is None:
                    os.killpg(started.pid, signal.SIGKILL)
    assert started.returncode == 0, told
    return folder
