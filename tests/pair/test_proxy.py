"""The proxy between the pair: what it shows, writes and judges."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from splatbus_client import Pose
from splatbus_conformance.cli.commands import proxy
from splatbus_conformance.cli.main import main
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.console import console
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.recording import load

from tests.pair.painting import is_whole, painter
from tests.pair.rig import MOST_SECONDS, serving
from tests.peers.raw_client import packet

Ports = tuple[int, int]


def proxied(listen: Ports, to: Ports, file: Path, seconds: float, *more: str) -> int:
    ends = [f"127.0.0.1:{ipc},{msg}" for ipc, msg in (listen, to)]
    line = ["--plain", "proxy", "--listen", ends[0], "--to", ends[1], "--record", str(file)]
    arguments = parser().parse_args([*line, "--seconds", str(seconds), *more])
    return proxy(arguments, console(True))


def connected(port: int) -> socket.socket:
    """A connection to the proxy, which may be about to start."""
    for _ in range(int(MOST_SECONDS / 0.05)):
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=MOST_SECONDS)
        except OSError:
            threading.Event().wait(0.05)
    raise TimeoutError(port)


def audited(file: Path, status: int) -> Path:
    """The report of an audit of a recording."""
    report = file.with_suffix(".audited.json")
    assert main(["--plain", "audit", str(file), "--json", str(report)]) == status
    return report


def verdicts(report: Path) -> dict[tuple[str, str], list[tuple[str, str]]]:
    """Of each side and requirement, what was found, in words."""
    return {
        (one["side"], each["id"]): [(it["verdict"], it["text"]) for it in each["results"]]
        for one in json.loads(report.read_text("utf-8"))
        for each in one["requirements"]
    }


def test_a_session_is_passed_on_written_down_and_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import splatbus_client

    listen = (free_port(), free_port())
    file, report = tmp_path / "session.jsonl", tmp_path / "report.json"
    whole = []

    def look() -> None:
        with splatbus_client.connect("127.0.0.1", *listen) as session:
            for x in range(20):
                pose = Pose((float(x), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
                session.send_camera(pose, tag=f"t{x}")
                with session.next_frame(MOST_SECONDS) as frame:
                    whole.append(is_whole(frame))
            session.viewport_size(MOST_SECONDS)

    with serving(painter()) as (bus, _):
        to = bus.address.ipc_port, bus.address.message_port
        client = threading.Thread(target=look)
        client.start()
        code = proxied(listen, to, file, 4.0, "--json", str(report))
        client.join(MOST_SECONDS)
    out = capsys.readouterr().out
    assert code == 0, out
    assert whole == [True] * 20
    assert "client: conforming at L0" in out
    assert "server: conforming at L0" in out
    assert [f.broken for f in audit(load(file)).findings if f.broken] == []
    assert len(json.loads(report.read_text("utf-8"))) == 2
    assert verdicts(report) == verdicts(audited(file, 0))


def test_what_is_broken_is_said_while_the_session_lasts_and_fails_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    listen = (free_port(), free_port())

    def misbehave() -> None:
        with connected(listen[1]) as client:
            client.sendall(packet({"type": "camera_pose", "position": {"x": 0.0}}))
            threading.Event().wait(2.0)

    with serving(painter()) as (bus, _):
        client = threading.Thread(target=misbehave)
        client.start()
        to = bus.address.ipc_port, bus.address.message_port
        file, report = tmp_path / "session.jsonl", tmp_path / "report.json"
        code = proxied(listen, to, file, 3.0, "--json", str(report))
        client.join(MOST_SECONDS)
    out = capsys.readouterr().out
    assert code == 1
    live, judged = out.index("FAIL POS-1 client"), out.index("client: not conforming")
    assert live < judged
    assert verdicts(report) == verdicts(audited(file, 1))


def test_a_server_that_comes_later_is_found_by_a_client_that_came_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import splatbus_client

    listen, to = (free_port(), free_port()), (free_port(), free_port())
    came, shown = threading.Event(), []

    def look() -> None:
        with connected(listen[0]):  # the proxy runs
            pass
        with splatbus_client.connect("127.0.0.1", *listen) as session:
            came.set()
            with session.next_frame(MOST_SECONDS) as frame:
                shown.append(is_whole(frame))

    def serve() -> None:
        came.wait(MOST_SECONDS)
        threading.Event().wait(1.0)
        with serving(painter(), ipc_port=to[0], message_port=to[1]):
            client.join(MOST_SECONDS)

    client, server = threading.Thread(target=look), threading.Thread(target=serve)
    client.start()
    server.start()
    code = proxied(listen, to, tmp_path / "session.jsonl", 8.0)
    client.join(MOST_SECONDS)
    server.join(MOST_SECONDS)
    out = capsys.readouterr().out
    assert shown == [True]
    assert f"no server at 127.0.0.1:{to[0]}" in out
    assert "start it, or say with --to where it is" in out
    assert "messages, " in out, "every few seconds a line says how it goes"
    assert code == 0, out


@pytest.mark.skipif(sys.platform == "win32", reason="no signal there is like Ctrl-C")
def test_ctrl_c_ends_the_session_and_judges_it(tmp_path: Path) -> None:
    listen = (free_port(), free_port())
    with serving(painter()) as (bus, _):
        to = bus.address.ipc_port, bus.address.message_port
        ends = [f"127.0.0.1:{ipc},{msg}" for ipc, msg in (listen, to)]
        line = ["--plain", "proxy", "--listen", ends[0], "--to", ends[1]]
        running = subprocess.Popen(
            [sys.executable, "-m", "splatbus_conformance", *line],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            text=True,
        )
        with connected(listen[1]) as client:
            client.sendall(packet({"type": "camera_pose", "position": {"x": 0.0}}))
            threading.Event().wait(0.5)
            running.send_signal(signal.SIGINT)
            out, _ = running.communicate(timeout=MOST_SECONDS)
    assert running.returncode == 1
    assert "client: not conforming: POS-1 broken" in out
    assert load(tmp_path / "splatbus-session.jsonl")
    assert "\x1b" not in out


def test_an_address_that_cannot_be_had_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for listen, to, problem in (
            ((port, 0), (1, 1), f"127.0.0.1:{port}"),
            ((1, 2), (0, 0), "HOST:IPC,MSG"),
        ):
            with pytest.raises(Usage, match=problem):
                proxied(listen, to, tmp_path / "session.jsonl", 1.0)
