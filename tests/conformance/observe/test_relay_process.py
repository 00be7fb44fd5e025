"""The relay as a process: what it says when it cannot start, and when something is amiss later."""

import socket
import sys
from pathlib import Path

import pytest
from splatbus_conformance.observe.relay_process import Endpoint, Relayed, endpoint, relayed
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.recording import load

from tests.waiting import eventually

MOST_SECONDS = 20.0


def listening(*, host: str = "127.0.0.1") -> Endpoint:
    return Endpoint(host, free_port(), free_port())


def warned(relay: Relayed) -> str:
    assert eventually(lambda: bool(relay.warnings))
    return relay.warnings[0]


@pytest.mark.parametrize(
    "text",
    ["localhost", "localhost:1", "localhost:1,2,3", "localhost:a,b", "localhost:0,1", ":70000,1"],
)
def test_an_address_that_is_none_is_explained(text: str) -> None:
    with pytest.raises(Usage, match="HOST:IPC,MSG"):
        endpoint(text)


def test_addresses_are_read_and_written_alike() -> None:
    assert endpoint(":7001,7000") == Endpoint("127.0.0.1", 7001, 7000)
    for text in ("127.0.0.1:7001,7000", "[::1]:7001,7000", "renderer.example:1,2"):
        assert str(endpoint(text)) == text


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        listen = Endpoint("127.0.0.1", taken.getsockname()[1], 1)
        with (
            pytest.raises(Usage, match=rf"127.0.0.1:{listen.ipc}: .*--listen names other ports"),
            relayed(listen, listening(), tmp_path / "session.jsonl"),
        ):
            pass


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    file = tmp_path / "nowhere" / "session.jsonl"
    with (
        pytest.raises(Usage, match=r"cannot write .*nowhere.*--record names another file"),
        relayed(listening(), listening(), file),
    ):
        pass


def test_a_host_that_nobody_knows_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(Usage, match=r"no host 'no such host'"),
        relayed(listening(), Endpoint("no such host", 1, 2), tmp_path / "session.jsonl"),
    ):
        pass


def test_a_relay_that_says_nothing_is_no_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false" if sys.platform != "win32" else "where")
    with pytest.raises(NoVerdict), relayed(listening(), listening(), tmp_path / "session.jsonl"):
        pass


def test_a_server_that_is_not_there_is_told_and_the_relay_goes_on(tmp_path: Path) -> None:
    listen, to = listening(), listening()
    with relayed(listen, to, tmp_path / "session.jsonl") as relay:
        with (
            pytest.raises(ConnectionResetError),  # it may come before `connect` has returned
            socket.create_connection(listen.at("msg"), timeout=MOST_SECONDS) as client,
        ):
            client.recv(1)
        told = warned(relay)
        assert "msg channel" in told
        assert f"127.0.0.1:{to.msg}" in told
        assert "start it, or say with --to where it is" in told
        with socket.create_server(to.at("msg")) as server:
            server.settimeout(MOST_SECONDS)
            with socket.create_connection(listen.at("msg"), timeout=MOST_SECONDS) as client:
                client.sendall(b"now")
                served, _ = server.accept()
                with served:
                    assert served.recv(3) == b"now"
    assert [entry.data for entry in load(tmp_path / "session.jsonl") if entry.data] == [b"now"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no file here is always full")
def test_what_cannot_be_recorded_passes_all_the_same() -> None:
    listen, to = listening(), listening()
    with (
        socket.create_server(to.at("msg")) as server,
        relayed(listen, to, Path("/dev/full")) as relay,
        socket.create_connection(listen.at("msg"), timeout=MOST_SECONDS) as client,
    ):
        server.settimeout(MOST_SECONDS)
        served, _ = server.accept()
        with served:
            for word in (b"one", b"two"):
                client.sendall(word)
                assert served.recv(3) == word
            assert "is not recorded: No space left" in warned(relay)
            assert relay.runs
        assert len(relay.warnings) == 1
