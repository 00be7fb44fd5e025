"""What another process holds is seen, where the system shows it."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.testee.os_evidence import (
    delays,
    holders,
    owner,
    wanted_seconds,
    writers,
)

from tests.waiting import eventually

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows it")

MAPS = """
import mmap, sys
file = open("/dev/shm/" + sys.argv[1], "rb")
memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
file.close()
print("mapped", flush=True)
sys.stdin.readline()
"""
CONNECTS = """
import socket, sys
sock = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
sys.stdin.readline()
"""


@contextmanager
def running(code: str, argument: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-c", code, argument],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # what it has started, too
        process.communicate(timeout=10)


def says(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


@pytest.mark.parametrize("how", ["mapped", "open"])
@pytest.mark.parametrize("mode", ["rb", "r+b", "copy"])
def test_who_holds_memory_also_once_it_was_removed_and_may_write_is_seen(
    how: str, mode: str
) -> None:
    code = MAPS.replace("_READ", "_COPY") if mode == "copy" else MAPS.replace('"rb"', f'"{mode}"')
    code = code if how == "mapped" else code.replace("file.close()", "memory.close()")
    memory = HostMemory(4096)
    assert holders(memory.name) == []
    with running(code, memory.name) as other:
        said = says(other)
        memory.close()
        assert (said, holders(memory.name)) == ("mapped", [other.pid])
        assert writers(memory.name) == ([other.pid] if mode == "r+b" else [])
        other.communicate("\n\n")
        assert holders(memory.name) == []


def test_the_owner_of_a_connection_is_found() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        with running(CONNECTS, str(port)) as other:
            accepted, (_, from_port) = listener.accept()
            with accepted:
                assert owner(from_port, port) == other.pid
                assert owner(port, from_port) == os.getpid()


SPINS = "while True: pass"


def test_a_process_that_is_kept_from_running_is_seen_to_be_delayed() -> None:
    """By another, on the one processor that both have; and so is one that it has started."""
    processor = {min(os.sched_getaffinity(0))}
    starts = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"
    with running(starts, SPINS) as first, running(SPINS, "") as rival:
        assert eventually(lambda: len(delays(first.pid)) > 1)
        (started,) = set(delays(first.pid)) - {first.pid}
        for pid in (started, rival.pid):
            os.sched_setaffinity(pid, processor)
        before = delays(first.pid)[started]
        assert eventually(lambda: delays(first.pid)[started] > before + 0.2)
        assert eventually(lambda: wanted_seconds(first.pid) > sum(delays(first.pid).values()) + 0.2)
    assert delays(first.pid) == delays(None) == {}
    assert not wanted_seconds(first.pid)
