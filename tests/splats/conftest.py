"""The renderer's loops are compiled by one of the processes to which tests are dealt."""

import sys
from pathlib import Path

import pytest
from splatbus_splats.drawing.kernels import compiled

from tests.splats.shots import cloud, drawn, view_of


@pytest.fixture(scope="session")
def loops() -> None:
    """They are compiled, and kept where other processes find them: while one of those that come
    here at a time compiles them, which takes ten seconds of a processor, the others wait.
    """
    if sys.platform == "win32":
        return
    import fcntl

    with Path(compiled.__file__).open("rb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # until it is closed
        drawn(view_of(), {"default": cloud(100)})
