"""The fork server: what it starts is as good as a process that was started in the usual way."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.zoo.faults.surgery import OF_THIS_RUN
from tests.zoo.processes import fork_server
from tests.zoo.processes.fork_server import COMMAND, forking_specimens

pytestmark = pytest.mark.skipif(not fork_server.POSSIBLE, reason="forks on Linux only")
SERVER = [*COMMAND, "server-has-one-name-for-its-memory"]
PATIENCE = 20.0


@pytest.fixture(autouse=True)
def _what_a_killed_server_leaves_goes():
    yield
    for left in Path("/dev/shm").glob(f"{OF_THIS_RUN}0-*"):
        left.unlink()


@pytest.fixture
def first():
    with forking_specimens():
        yield


def start(line, log, **environment):
    """As a testee is started: on ports that are free, with what it prints in a file."""
    ports = {"SPLATBUS_IPC_PORT": "0", "SPLATBUS_MSG_PORT": "0"}
    with log.open("ab") as file:
        return subprocess.Popen(
            line,
            env={**os.environ, **ports, **environment},
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
            process_group=0,
        )


def test_what_a_specimen_ends_with_arrives(first, tmp_path):
    log = tmp_path / "log"
    started = start([*SERVER, "--no-such-option"], log)
    assert isinstance(started, fork_server.Started)
    assert started.wait(PATIENCE) == 2
    assert started.poll() == 2
    assert "--no-such-option" in log.read_text()


def test_a_specimen_runs_until_it_is_ended(first, tmp_path):
    started = start([*SERVER, "--quiet"], tmp_path / "log")
    with pytest.raises(subprocess.TimeoutExpired):
        started.wait(0.3)
    assert started.poll() is None
    started.kill()
    assert started.wait(PATIENCE) == -signal.SIGKILL


def test_a_specimen_leads_its_group_and_has_files_of_its_own_only(tmp_path):
    harness, log = tmp_path / "of the harness", tmp_path / "log"
    with harness.open("wb"), forking_specimens():
        started = start([*SERVER, "--quiet"], log)
        with pytest.raises(subprocess.TimeoutExpired):
            started.wait(0.3)
    group = os.getpgid(started.pid)
    held = [file.readlink() for file in Path(f"/proc/{started.pid}/fd").iterdir()]
    os.kill(started.pid, signal.SIGKILL)
    assert started.wait(PATIENCE) == -signal.SIGKILL
    assert group == started.pid
    assert held.count(log) == 2
    assert harness not in held


def test_each_start_begins_anew(first, tmp_path):
    log = tmp_path / "log"
    texts = []
    for _ in range(2):
        started = start([*COMMAND, "crashes-on-broken-text", "view", "--no-such-option"], log)
        started.wait(PATIENCE)
        texts.append(log.read_text())
    assert texts[1] == texts[0] * 2


def test_what_is_no_specimen_is_started_as_ever(first, tmp_path):
    log = tmp_path / "log"
    started = start([sys.executable, "-c", "raise SystemExit(7)"], log)
    assert not isinstance(started, fork_server.Started)
    assert started.wait(PATIENCE) == 7


def test_a_specimen_is_executed_where_other_libraries_are_to_be_found(first, tmp_path):
    started = start([*SERVER, "--no-such-option"], tmp_path / "log", LD_LIBRARY_PATH="elsewhere")
    assert not isinstance(started, fork_server.Started)
    assert started.wait(PATIENCE) == 2


def test_an_adapter_is_spoken_to_through_pipes(first, tmp_path):
    line = [*COMMAND, "types-the-root-of-one-half", "--axes", "unity"]
    with (tmp_path / "log").open("ab") as log:
        started = subprocess.Popen(
            line,
            env=dict(os.environ),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
        )
    with started.stdin as stdin, started.stdout as stdout:
        stdin.write(b'{"command": "hello"}\n')
        stdin.flush()
        assert stdout.readline().startswith(b"{")
    assert started.wait(PATIENCE) is not None
