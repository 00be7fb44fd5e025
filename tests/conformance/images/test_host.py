"""The harness leaves nothing behind in shared memory."""

import os
import signal
import subprocess
import sys
import time

import pytest
from splatbus_conformance.images.memory.host import LINUX_FOLDER, YOUNG_SECONDS, HostMemory, sweep

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux alone lists shared memory")
HOLD = (
    "import sys, time; from splatbus_conformance.images.memory.host import HostMemory; "
    "print(HostMemory(4096).name, flush=True); time.sleep(60)"
)


def age(name: str) -> None:
    long_ago = time.time() - 2 * YOUNG_SECONDS
    os.utime(LINUX_FOLDER / name, (long_ago, long_ago))


def test_memory_goes_when_it_is_closed() -> None:
    memory = HostMemory(4096)
    assert memory.exists()
    memory.close()
    assert not memory.exists()


def test_what_a_killed_run_left_is_swept_and_what_lives_is_not() -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    name = holder.stdout.readline().strip()
    age(name)
    sweep()
    assert (LINUX_FOLDER / name).exists()
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    holder.stdout.close()
    sweep()
    assert not (LINUX_FOLDER / name).exists()


def test_a_write_by_somebody_else_changes_the_digest() -> None:
    memory = HostMemory(4096)
    try:
        before = memory.digest()
        with (LINUX_FOLDER / memory.name).open("r+b") as file:
            file.write(b"x")
        assert memory.digest() != before
    finally:
        memory.close()
