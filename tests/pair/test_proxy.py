"""The proxy between the pair: what it shows, writes and judges."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
import splatbus_client
from splatbus_client import Pose
from splatbus_conformance.cli.main import main
from splatbus_conformance.wire.ports import free_port

from tests.pair.painting import is_whole, painter
from tests.pair.rig import MOST_SECONDS, serving
from tests.peers.raw_client import packet
from tests.waiting import eventually

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no signal there is like Ctrl-C")
WHO = [sys.executable, "-m", "splatbus_conformance", "--plain"]


class Proxy(NamedTuple):
    """One that runs in a folder, until it is told to end."""

    folder: Path
    process: subprocess.Popen[str]
    ports: tuple[int, int]
    lines: list[str]

    def tells(self, words: str) -> bool:
        """Reads on until it says so."""
        assert self.process.stdout is not None
        while words not in (line := self.process.stdout.readline()):
            self.lines.append(line)
            if not line:
                return False
        return True

    def end(self, status: int) -> str:
        """Ends it as Ctrl-C does; what it said. An audit of what it wrote comes to the same."""
        self.process.send_signal(signal.SIGINT)
        said, _ = self.process.communicate(timeout=MOST_SECONDS)
        assert self.process.returncode == status, said
        file, report = (self.folder / name for name in ("splatbus-session.jsonl", "again.json"))
        assert main(["--plain", "audit", str(file), "--json", str(report)]) == status
        assert verdicts(self.folder / "report.json") == verdicts(report)
        assert "\x1b" not in said
        return "".join([*self.lines, said])


def verdicts(report: Path) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Of each side and requirement, what was found, in words."""
    return {
        (one["side"], each["id"]): [(it["verdict"], it["text"]) for it in each["results"]]
        for one in json.loads(report.read_text("utf-8"))
        for each in one["requirements"]
    }


@contextmanager
def proxied(folder: Path, to: tuple[int, int]) -> Iterator[Proxy]:
    ports = free_port(), free_port()
    ends = [f"127.0.0.1:{ipc},{msg}" for ipc, msg in (ports, to)]
    line = [*WHO, "proxy", "--listen", ends[0], "--to", ends[1], "--json", "report.json"]
    with subprocess.Popen(line, cwd=folder, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Proxy(folder, process, ports, [])
        finally:
            process.kill()


def test_a_session_is_passed_on_written_down_and_judged(tmp_path: Path) -> None:
    """Also where the server comes later than the client."""
    to = free_port(), free_port()
    with ExitStack() as stack:
        proxy = stack.enter_context(proxied(tmp_path, to))
        session = stack.enter_context(splatbus_client.connect("127.0.0.1", *proxy.ports))
        assert proxy.tells(f"no server at 127.0.0.1:{to[0]}")
        assert proxy.tells("start it, or say with --to where it is")
        stack.enter_context(serving(painter(), ipc_port=to[0], message_port=to[1]))
        for x in range(20):
            pose = Pose((float(x), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            session.send_camera(pose, tag=f"t{x}")
            with session.next_frame(MOST_SECONDS) as frame:
                assert is_whole(frame)
        session.viewport_size(MOST_SECONDS)
        assert proxy.tells("messages, "), "every few seconds a line says how it goes"
        said = proxy.end(0)
    assert "client: conforming at L0" in said
    assert "server: conforming at L0" in said


def test_what_is_broken_is_said_at_once_and_fails_the_session(tmp_path: Path) -> None:
    def connects() -> bool:
        try:
            clients.append(socket.create_connection(("127.0.0.1", proxy.ports[1])))
        except OSError:
            return False
        return True

    clients: list[socket.socket] = []
    with serving(painter()) as (bus, _):
        to = bus.address.ipc_port, bus.address.message_port
        with proxied(tmp_path, to) as proxy:
            assert eventually(connects, 4 * MOST_SECONDS)
            with clients[0] as client:
                client.sendall(packet({"type": "camera_pose", "position": {"x": 0.0}}))
                assert proxy.tells("FAIL POS-1 client")
                assert "client: not conforming: POS-1 broken" in proxy.end(1)


@pytest.mark.parametrize(("to", "words"), [("1,2", "127.0.0.1:{taken}"), ("0,0", "HOST:IPC,MSG")])
def test_an_address_that_cannot_be_had_is_named(tmp_path: Path, to: str, words: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = [
            *WHO,
            "proxy",
            "--listen",
            f"127.0.0.1:{port},{free_port()}",
            "--to",
            f"127.0.0.1:{to}",
        ]
        ended = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 2
    assert words.format(taken=port) in ended.stdout
