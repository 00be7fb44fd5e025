"""What a first meeting suggests: of real programs that make the likeliest mistakes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from splatbus_conformance.plan import Plan, Side
from splatbus_conformance.run.testbed import set_up
from splatbus_conformance.wire.ports import free_port

from tests.conformance.harness import GOOD, MINIATURE, broken
from tests.peers.legacy_server import running

SAYS = """
import os, socket, sys, time
while True:
    try:
        port = int(os.environ["SPLATBUS_MSG_PORT"])
        with socket.create_connection((os.environ["SPLATBUS_HOST"], port)) as sock:
            sock.sendall(bytes.fromhex(sys.argv[1]))
            while sock.recv(4096):
                pass
    except OSError:
        pass
    time.sleep(0.1)
"""
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


@pytest.fixture
def says(tmp_path: Path):
    """The command of a client that sends these bytes on the message channel, and no more."""
    script = tmp_path / "says.py"
    script.write_text(SAYS, "utf-8")
    return lambda data: f'"{sys.executable}" "{script}" {data.hex()}'


def test_a_good_client_is_told_nothing() -> None:
    assert advice(GOOD) == ""


def test_foreign_bytes_are_recognised_and_a_channel_without_a_connection_is_named(says) -> None:
    ports = free_port(), free_port()
    told = advice(says(len(TEXT).to_bytes(4, "big") + TEXT), ports)
    assert "On the message channel came bytes that are no packet: 00 00 00 1c" in told
    assert "the length has to be little-endian (FRM-1)" in told
    assert f"Nothing connected to the IPC channel, port {ports[0]}" in told


def test_a_client_with_swapped_ports_is_found_out(tmp_path: Path) -> None:
    """By its poses if it speaks 1.0, by its hello if it speaks 1.1."""
    swapped = broken(
        tmp_path,
        ('environ.get("SPLATBUS_IPC_PORT"', 'environ.get("OTHER"'),
        ('environ.get("SPLATBUS_MSG_PORT"', 'environ.get("SPLATBUS_IPC_PORT"'),
        ('environ.get("OTHER"', 'environ.get("SPLATBUS_MSG_PORT"'),
    )
    for command in (swapped, swapped.removesuffix("1.1") + "1.0"):
        assert "The two ports may be swapped" in advice(command)


def test_a_client_that_insists_on_its_own_size_is_told_of_viewport(tmp_path: Path) -> None:
    command = broken(
        tmp_path,
        ('        meta, ring, memory, means = (', '        if message["meta"]["w"] != 1920:\n'
         '            raise Bad("size")\n        meta, ring, memory, means = ('),
    )  # fmt: skip
    told = advice(command)
    assert "when it was told of images of 64x48" in told
    assert "--viewport 1920x1080" in told
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


def server_advice(ports: tuple[int, int]) -> str:
    return said_of(plan("server", None, ports))


def test_a_server_on_swapped_ports_is_found_out() -> None:
    with running() as (ipc, msg):
        assert server_advice((ipc, msg)) == ""
        assert "an init packet came on the message channel" in server_advice((msg, ipc))
