"""A testee that loses what it could do when it was met, and whom that is charged to."""

import json
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.testbed import Testbed, set_up
from splatbus_conformance.run.vital_signs import BRIEF_SECONDS
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee import server_probe
from splatbus_conformance.wire.messages import init_packet_1_0
from splatbus_schemas.requirements import requirements

from tests.conformance.harness import run

SERVES = """
import os, socket, threading, time
from contextlib import nullcontext

PLACE = nullcontext()

def packet(connection):
    header = connection.recv(4, socket.MSG_WAITALL)
    size = int.from_bytes(header, "little")
    return connection.recv(size, socket.MSG_WAITALL) if len(header) == 4 else b""

def serve(connection):
    with connection, PLACE:
        while request := packet(connection):
            if b"get_viewport_size" in request:
                reply = b'{"viewport_size":[64,48]}'
                connection.sendall(len(reply).to_bytes(4, "little") + reply)
"""
DIES = """
def listen(name, most):
    listener = socket.create_server(("127.0.0.1", int(os.environ[name])))
    for _ in range(most):
        threading.Thread(target=serve, args=(listener.accept()[0],), daemon=True).start()
    listener.close()
    print("no more of", name, flush=True)

threading.Thread(target=listen, args=("SPLATBUS_IPC_PORT", 10_000), daemon=True).start()
listen("SPLATBUS_MSG_PORT", MOST)
while True:
    time.sleep(1)
"""
MET = 5
"""Connections to the message channel while it is met, and by the check that passes."""


def written(tmp_path: Path, *lines: str) -> str:
    """The command of a server of these lines."""
    program = tmp_path / "server.py"
    program.write_text("\n".join(lines), "utf-8")
    return f'"{sys.executable}" "{program}"'


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """These servers answer at once or never."""
    monkeypatch.setattr(server_probe, "REPLY_SECONDS", 0.5)
    monkeypatch.setattr(server_probe, "FRAME_SECONDS", 1.5)


@contextmanager
def met(command: str, of: Testbed | None = None) -> Iterator[Testbed]:
    """A testbed with a server that was met, or is met again as it was on another."""
    testbed = set_up(Plan("server", command, "127.0.0.1", (0, 0), (0, 0), 10.0))
    with closing(testbed):
        if of:
            testbed.meet_again(of.facts)
        else:
            testbed.introduce()
        yield testbed


def test_a_channel_that_dies_in_a_live_process_is_charged_to_the_check_before(
    tmp_path: Path,
) -> None:
    path = tmp_path / "report.json"
    code, output = run(
        *("server", "--launch", written(tmp_path, f"MOST = {MET}", SERVES, DIES)),
        *("--select", "CHN-1"),
        *("--json", str(path), "--patience", "2", "--shrink", "0"),
        *("--scripts", str(tmp_path / "scripts")),
    )
    report = json.loads(path.read_text())
    assert code == 1, output
    found = {it["id"]: it["results"] for it in report["requirements"] if it["results"]}
    (passed_before,) = found["CHN-1"]
    assert passed_before["verdict"] == "skip"
    (loss,) = found["CHN-14"]
    assert (loss["verdict"], loss["check"]) == ("fail", passed_before["check"])
    assert "it accepts no connection on the message channel any more" in loss["text"]
    assert "no more of SPLATBUS_MSG_PORT" in loss["text"]
    assert loss["replay"].startswith("splatbus-conformance replay")
    assert "not conforming: CHN-14 broken" in output


ONE_AT_A_TIME = """
def await_place(connection):
    if PLACE.acquire(timeout=WAITS):
        PLACE.release()
        serve(connection)
    else:
        connection.close()

def listen(name, talk):
    listener = socket.create_server(("127.0.0.1", int(os.environ[name])))
    while True:
        threading.Thread(target=talk, args=(listener.accept()[0],), daemon=True).start()

PLACE = threading.Lock()
threading.Thread(target=listen, args=("SPLATBUS_IPC_PORT", packet), daemon=True).start()
listen("SPLATBUS_MSG_PORT", await_place)
"""


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("waits", [0.5, 60.0])
def test_a_server_that_has_a_further_client_wait_serves_one(tmp_path: Path, waits: float) -> None:
    """Whether it closes that one in time (CHN-13) or not."""
    with met(written(tmp_path, f"WAITS = {waits}", SERVES, ONE_AT_A_TIME)) as testbed:
        assert testbed.facts.alone == {"ipc": False, "msg": True}


@pytest.mark.usefixtures("hasty")
def test_a_loss_that_nobody_is_charged_with_is_looked_for_briefly(tmp_path: Path) -> None:
    with met(written(tmp_path, f"MOST = {MET}", SERVES, DIES)) as testbed:
        while not testbed.lost(briefly=False):
            pass
        waited: list[float] = []
        until = testbed.peer.until
        testbed.peer.until = lambda condition, seconds: (  # type: ignore[method-assign]
            waited.append(seconds),
            until(condition, seconds),
        )[1]
        assert "it accepts no connection on the message channel" in testbed.lost(briefly=True)
        assert max(waited) <= BRIEF_SECONDS


LOADS = """
STARTED, INIT = time.monotonic(), json.dumps(INIT_PACKET).encode()

def has_drawn():
    return time.monotonic() > STARTED + 1.0

def announce(connection):
    while not has_drawn():
        time.sleep(0.01)
    connection.sendall(len(INIT).to_bytes(4, "little") + INIT)
    packet(connection)

def answer(connection):
    while packet(connection):
        size = [64, 48] if has_drawn() else [0, 0]
        reply = json.dumps({"viewport_size": size}).encode()
        connection.sendall(len(reply).to_bytes(4, "little") + reply)

def listen(name, talk):
    listener = socket.create_server(("127.0.0.1", int(os.environ[name])))
    while True:
        threading.Thread(target=talk, args=(listener.accept()[0],), daemon=True).start()

threading.Thread(target=listen, args=("SPLATBUS_IPC_PORT", announce), daemon=True).start()
listen("SPLATBUS_MSG_PORT", answer)
"""


def test_a_server_that_is_started_anew_is_tried_once_it_has_drawn(tmp_path: Path) -> None:
    """What a server tells before its first image is no answer to what it told when it was met."""
    loads = written(tmp_path, f"import json; INIT_PACKET = {init_packet_1_0()!r}", SERVES, LOADS)

    def told(testbed: Testbed) -> object:
        trial = testbed.trial(requirements("1.1")["REQ-3"])
        assert isinstance(trial, ServerTrial)
        return trial.ask(trial.before_hello("msg"), VIEWPORT_REQUEST)

    with met(loads) as testbed:
        testbed.testee.stop()
        assert told(testbed) == {"viewport_size": [64, 48]}
        with met(loads, of=testbed) as another:
            assert told(another) == {"viewport_size": [64, 48]}


def test_a_client_that_the_last_check_ended_has_lost_nothing() -> None:
    """OPN-10 ends it, to look at the memory afterwards, and here no check follows."""
    command = f'"{sys.executable}" -m splatbus_viewer view'
    status, told = run("client", "--launch", command, "--select", "OPN-10", "--shrink", "0")
    assert (status, "lost-a-vital-sign" in told) == (0, False), told
