"""Nothing outlives the harness, in whichever way it ends."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from splatbus_conformance.guard import uninterrupted
from splatbus_conformance.trials.testee.os_evidence import members

from tests.waiting import eventually

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there are no groups of processes")
HOLDS = """
import subprocess, sys, time
from pathlib import Path
from splatbus_conformance import guard
from splatbus_conformance.images.memory.cuda_stand_in.device import StandInDevice
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.testee.process import Launched

device = StandInDevice()
device.allocate(1)
given_back = HostMemory(10)
given_back.close()
testee = Launched(f"sh -c '{sys.argv[1]} & wait'", {})
testee.ensure_running()
print(device.folder, Path("/dev/shm", HostMemory(4096).name), testee._command._log)
print(testee.group, flush=True)
time.sleep(600)
"""
STUBBORN = 'trap "" TERM; while true; do sleep 600 & wait; done'
"""Goes on when it is asked to end."""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_harness_that_is_ended_leaves_nothing(number: int, tmp_path: Path) -> None:
    script = tmp_path / "stubborn.sh"
    script.write_text(STUBBORN, "utf-8")
    line = [sys.executable, "-c", HOLDS, f"sh {script}"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as it:
        assert it.stdout is not None
        paths = [Path(word) for word in it.stdout.readline().split()]
        group = int(it.stdout.readline())
        assert all(path.exists() for path in paths)
        os.killpg(group, 0)
        it.send_signal(number)
    assert eventually(lambda: not any(path.exists() for path in paths))
    assert eventually(lambda: not [pid for pid in members(group) if runs(pid)])


def runs(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False


def test_an_interrupt_waits_for_what_must_not_be_half_done() -> None:
    done = []

    def begin() -> None:
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            done.append("the rest")
        done.append("what follows")

    with pytest.raises(KeyboardInterrupt):
        begin()
    assert done == ["the rest"]
