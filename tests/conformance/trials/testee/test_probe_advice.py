"""What a first meeting suggests: of real programs that make the likeliest mistakes."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.trials.testee.probe_advice import (
    ObservedConnection,
    on_client,
    on_server,
)
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.recording import Channel

from tests.conformance.harness import GOOD, MINIATURE, broken
from tests.peers.legacy_server import running

BEGINS = 'if __name__ == "__main__":\n'
"""Of the part of the miniature that runs first."""
CONNECTED = """def connected(port):
    lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return any(it[2].endswith(f":{port:04X}") and it[3] == "01" for it in lines)"""
"""Whether somebody has a connection to a port: the second client starts after the first has."""
TEXT = b'{"type":"get_viewport_size"}'


def plan(side: Side, launch: str | None, ports: tuple[int, int] = (0, 0)) -> Plan:
    return Plan(side, launch, "127.0.0.1", ports, (64, 48), patience=20.0)


def advice(command: str, ports: tuple[int, int] = (0, 0)) -> str:
    """What is said of a client that is launched, once it was met."""
    return said_of(plan("client", command, ports))


def said_of(plan: Plan) -> str:
    testbed = set_up(plan)
    try:
        testbed.introduce()
        return "\n".join(testbed.facts.advice)
    finally:
        testbed.close()


def test_a_good_client_is_told_nothing() -> None:
    assert advice(GOOD) == ""


def seen(channel: Channel, **what: Any) -> ObservedConnection:
    return ObservedConnection(channel, 1, **what)


ODD = {"type": "hello", "capabilities": ["frames"]}, {"type": "welcome", "capabilities": ["scene"]}
STAYS = seen("ipc")


@pytest.mark.parametrize(
    ("met", "words"),
    [
        ([STAYS], "Nothing connected to the message channel, port 2"),
        ([seen("ipc", heard=[{"type": "camera_pose"}])], "camera_pose came on the IPC channel"),
        ([STAYS, seen("msg", heard=[ODD[0]])], "lists what belongs to the other: frames. --ports"),
        ([STAYS, seen("msg", process=8)], "Process 8 connects, which the harness did not start"),
        ([STAYS, *(seen("msg", process=it) for it in (4, 5))], "to the message channel: 4 and 5"),
        ([STAYS, seen("msg", refused=b"GET / HTTP/1.1\r\n")], "this is HTTP"),
        (
            [STAYS, seen("msg", refused=b"\xff" * 9)],
            "the message channel came bytes that are no",
        ),
        ([STAYS, seen("msg", unread=TEXT + b"\0")], "the text has no terminator (FRM-1)"),
        ([STAYS, seen("msg", unfinished=TEXT)], "the length does not count the header (FRM-1)"),
        ([STAYS, seen("msg", rate=12_000.0)], "sends 12,000 messages a second"),
    ],
)
def test_a_client_is_told_one_thing(met: list[ObservedConnection], words: str) -> None:
    (told,) = on_client(met, {"ipc": 1, "msg": 2}, 4)
    assert words in told


@pytest.mark.parametrize(
    ("met", "more", "words"),
    [
        (seen("msg", heard=[{"meta": {}}]), (), "an init packet came on the message channel"),
        (seen("ipc", heard=[ODD[1]]), (), "the welcome on the IPC channel, port 1, lists what"),
        (STAYS, (True, False), "SPLATBUS_TOKEN is set here"),
        (STAYS, (False, True), "announced no memory"),
    ],
)
def test_a_server_is_told_one_thing(
    met: ObservedConnection, more: tuple[bool, ...], words: str
) -> None:
    (told,) = on_server([met], *more)
    assert words in told


def test_a_client_that_insists_on_its_own_size_is_told_of_viewport(tmp_path: Path) -> None:
    command = broken(
        tmp_path,
        ('        meta, ring, memory, means = (', '        if message["meta"]["w"] != 1920:\n'
         '            raise Bad("size")\n        meta, ring, memory, means = ('),
    )  # fmt: skip
    told = advice(command)
    assert "when it was told of images of 64x48" in told
    assert "--viewport 1920x1080" in told
    first = "        meta, ring, memory, means = ("
    told = advice(broken(tmp_path, (first, f"        os._exit(0)\n{first}")))
    assert "Your client ended with status 0 while it was served." in told
    assert "--viewport" not in told
    told = advice(broken(tmp_path, ('memory["kind"] == "host_shm"', "False")))
    assert "it says 'a rule is broken'" in told


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux shows whose a connection is")
def test_a_client_that_was_left_over_is_told_by_its_process(tmp_path: Path) -> None:
    ports = free_port(), free_port()
    looks = f"{BEGINS}    while not connected(MSG): time.sleep(0.01)\n"
    second = broken(tmp_path, (BEGINS, f"{CONNECTED}\n\n{looks}"))
    environment = {"SPLATBUS_IPC_PORT": str(ports[0]), "SPLATBUS_MSG_PORT": str(ports[1])}
    stale = subprocess.Popen(
        [sys.executable, str(MINIATURE), "1.1"], env={**os.environ, **environment}
    )
    try:
        told = advice(second, ports)
    finally:
        stale.kill()
        stale.wait()
    assert str(stale.pid) in told
    assert "left over from before" in told


def test_a_server_on_swapped_ports_is_found_out() -> None:
    with running() as (ipc, msg):
        assert said_of(plan("server", None, (ipc, msg))) == ""
        told = said_of(plan("server", None, (msg, ipc)))
        assert "an init packet came on the message channel" in told
