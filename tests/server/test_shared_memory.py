"""Segments are private, whole, and gone when their owner is, however it ended."""

import contextlib
import errno
import os
import re
import secrets
import subprocess
import sys

import numpy as np
import pytest
from splatbus_server import shared_memory
from splatbus_server.shared_memory import (
    DIRECTORY,
    create,
    create_with_standard_library,
    sweep_stale,
)

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="segments are files on Linux only")

OWNER = """
import sys
from splatbus_server.shared_memory import create
segment = create(100_000, sys.argv[1])
segment.buffer[:4] = b"live"
print(segment.name, flush=True)
sys.stdin.read()
"""


@pytest.fixture
def prefix():
    """Sweeping by it touches nobody else's memory."""
    return f"test-{secrets.token_hex(4)}-"


@contextlib.contextmanager
def owner(prefix):
    """Another process that owns a segment; yields the process and the segment's path."""
    command = [sys.executable, "-c", OWNER, prefix]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield process, DIRECTORY / process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate(timeout=30)


@pytest.mark.parametrize("make", [shared_memory._create_named, create_with_standard_library])
def test_memory_is_zero_writable_and_as_large_as_asked(prefix, monkeypatch, make):
    """Whoever makes it; and its name is free again afterwards."""
    monkeypatch.setattr(shared_memory, "_create_named", make)
    with contextlib.closing(create(10_001, prefix)) as segment:
        assert len(segment.buffer) == 10_001
        assert not any(segment.buffer)
        segment.buffer[10_000] = 7
        assert re.fullmatch(prefix + r"[A-Za-z0-9._-]{1,13}", segment.name)
        assert make(segment.name, 10_001) is None
    if sys.platform == "linux":
        assert not (DIRECTORY / segment.name).exists()


@on_linux
def test_others_of_this_user_read_what_is_written_and_nobody_else_can(prefix):
    with contextlib.closing(create(4096, prefix)) as segment:
        segment.buffer[:5] = b"hello"
        path = DIRECTORY / segment.name
        assert path.read_bytes()[:5] == b"hello"
        assert path.stat().st_mode & 0o777 == 0o400
        assert segment.taken() == ""
        os.truncate(path, 4095)
        assert segment.taken() == f"the end of {path}"
        os.truncate(path, 4096)
        assert path.stat().st_blocks * 512 >= 4096


@on_linux
def test_closing_removes_the_name_even_while_arrays_view_the_memory(prefix):
    segment = create(4096, prefix)
    view = np.frombuffer(segment.buffer, np.float32)
    segment.close()
    segment.close()
    assert not (DIRECTORY / segment.name).exists()
    assert view[0] == 0.0


@on_linux
def test_what_a_killed_owner_left_is_swept_and_a_live_neighbour_is_not(prefix):
    with owner(prefix) as (live, neighbour), owner(prefix) as (killed, stale):
        killed.kill()
        killed.wait(timeout=30)
        assert stale.exists()
        assert sweep_stale(prefix) == [stale.name]
        assert not stale.exists()
        assert neighbour.read_bytes()[:4] == b"live"
        assert live.poll() is None
        live.kill()
        live.wait(timeout=30)
        assert sweep_stale(prefix) == [neighbour.name]


@on_linux
def test_a_sweep_spares_what_is_owned_and_what_is_no_segment(prefix, tmp_path):
    """It neither follows links nor waits for pipes."""
    target, other = tmp_path / "target", DIRECTORY / f"other-{prefix}x"
    link, pipe = DIRECTORY / f"{prefix}link", DIRECTORY / f"{prefix}pipe"
    try:
        for path in (target, other):
            path.touch()
        link.symlink_to(target)
        os.mkfifo(pipe)
        with contextlib.closing(create(4096, prefix)) as segment:
            sweep_stale(prefix)
            assert (DIRECTORY / segment.name).exists()
        assert other.exists()
        assert target.exists()
    finally:
        for path in (other, link, pipe):
            path.unlink(missing_ok=True)


@on_linux
@pytest.mark.parametrize("lost_to", ["a sweep that is done", "a sweep that goes on"])
def test_a_file_that_a_sweep_takes_before_it_is_locked_is_made_anew(prefix, monkeypatch, lost_to):
    flock = shared_memory.fcntl.flock
    swept = []

    def sweep_first(file, operation):
        if not swept:
            swept.append(None)
            if lost_to == "a sweep that goes on":
                raise BlockingIOError
            swept.extend(sweep_stale(prefix))
        flock(file, operation)

    monkeypatch.setattr(shared_memory.fcntl, "flock", sweep_first)
    with contextlib.closing(create(4096, prefix)) as segment:
        assert [path.name for path in DIRECTORY.glob(f"{prefix}*")] == [segment.name]
        assert segment.name not in swept
        assert sweep_stale(prefix) == []


@on_linux
def test_what_does_not_fit_takes_no_page_and_leaves_nothing(prefix, monkeypatch):
    """Reserving would take all that is left before it fails, and other programs need it."""
    monkeypatch.setattr(os, "posix_fallocate", lambda *_: pytest.fail("pages were reserved"))
    system = os.statvfs(DIRECTORY)
    size = system.f_blocks * system.f_frsize + 1
    with pytest.raises(OSError, match=f"no {size} bytes .* are free") as caught:
        create(size, prefix)
    assert caught.value.errno == errno.ENOSPC
    assert not list(DIRECTORY.glob(f"{prefix}*"))


@pytest.mark.parametrize(("size", "prefix"), [(0, "a"), (-1, "a"), (1, "../a"), (1, "a" * 19)])
def test_impossible_sizes_and_names_are_refused(size, prefix):
    with pytest.raises(ValueError, match="shared memory"):
        create(size, prefix)
