"""The relay as a process: what it says when it cannot start, and when something is amiss later."""

import json
import os
import socket
import sys
from pathlib import Path

import pytest
from splatbus_conformance.observe.door import Door
from splatbus_conformance.observe.relay_process import Endpoint, Relayed, endpoint, relayed
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.recording import load

from tests.waiting import eventually

MOST_SECONDS = 20.0
TOKEN = "a token of the proxy's server"
EVERYWHERE = "0.0.0.0"


def listening(*, host: str = "127.0.0.1") -> Endpoint:
    return Endpoint(host, free_port(), free_port())


def warned(relay: Relayed) -> str:
    assert eventually(lambda: bool(relay.warnings))
    return relay.warnings[0]


def test_addresses_are_read_and_written_alike() -> None:
    assert endpoint(":7001,7000") == Endpoint("127.0.0.1", 7001, 7000)
    for text in ("127.0.0.1:7001,7000", "[::1]:7001,7000", "renderer.example:1,2"):
        assert str(endpoint(text)) == text
    for text in ("localhost:7001,7001", "localhost:1,2,3", "localhost:a,b", ":70000,1", ":0,1"):
        with pytest.raises(Usage, match=r"HOST:IPC,MSG|need a port each"):
            endpoint(text)


def test_why_it_does_not_start_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, to = tmp_path / "session.jsonl", listening()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for listen, where, path, words in (
            (Endpoint("127.0.0.1", port, 1), to, file, rf"127.0.0.1:{port}: .*--listen names"),
            (
                listening(),
                to,
                tmp_path / "no" / "such",
                r"cannot write .*no/such: .*--record names",
            ),
            (listening(), Endpoint("no such host", 1, 2), file, r"--to: no host 'no such host'"),
        ):
            with pytest.raises(Usage, match=words), relayed(listen, where, path):
                pass
    monkeypatch.setattr(sys, "executable", "/bin/false" if sys.platform != "win32" else "where")
    with pytest.raises(NoVerdict), relayed(listening(), to, file):
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


def hello(token: object = TOKEN) -> bytes:
    return packet(json.dumps({"type": "hello", "token": token}).encode())


@pytest.mark.skipif(os.name != "posix", reason="files have no such mode there")
@pytest.mark.parametrize("existed", [False, True])
def test_a_recording_is_for_its_owner_alone(existed: bool, tmp_path: Path) -> None:
    file = tmp_path / "session.jsonl"
    if existed:
        file.write_text("what was here before\n")
        file.chmod(0o666)
    with relayed(listening(), listening(), file):
        assert file.stat().st_mode & 0o777 == 0o600
        assert file.read_text() == ""


@pytest.mark.parametrize("host", [EVERYWHERE, "::"])
@pytest.mark.parametrize("token", ["", "fifteen letters"])
def test_without_a_token_others_cannot_connect(
    host: str, token: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPLATBUS_TOKEN", token)
    with (
        pytest.raises(Usage, match=r"16 characters, into SPLATBUS_TOKEN, .*\[NEG-17\]"),
        relayed(listening(host=host), listening(), tmp_path / "session.jsonl"),
    ):
        pass
    assert not (tmp_path / "session.jsonl").exists()


@pytest.mark.parametrize(
    "said",
    [
        *(hello("another token, as long"), hello(None), packet(b'{"type": "set_time"}')),
        *(b"\0\0\0\0", b"\xff\xff\xff\xff", packet(b" " * 70_000)[:9], packet(b"[1]")),
    ],
    ids=range(7),
)
def test_the_door_opens_to_who_says_the_token_first(said: bytes) -> None:
    door = Door(TOKEN, lambda channel: None)
    assert door.opens(said) is False
    assert door.opens(hello()) is True
    assert all(door.opens(hello()[:end]) is None for end in range(len(hello())))


def test_a_token_opens_and_passes_and_is_left_out_of_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPLATBUS_TOKEN", TOKEN)
    listen, to, file = listening(host=EVERYWHERE), listening(), tmp_path / "session.jsonl"
    door = ("127.0.0.1", listen.msg)
    answer = packet(json.dumps({"type": "error", "message": f"{TOKEN} is wrong"}).encode())
    with socket.create_server(to.at("msg")) as server, relayed(listen, to, file) as relay:
        server.settimeout(MOST_SECONDS)
        with socket.create_connection(door, timeout=MOST_SECONDS) as client:
            client.sendall(hello()[:9])
            client.shutdown(socket.SHUT_WR)
            with pytest.raises(ConnectionResetError):
                client.recv(1)
        assert "turned away" in warned(relay)
        with socket.create_connection(door, timeout=MOST_SECONDS) as client:
            for byte in hello():
                client.sendall(bytes([byte]))
            served, _ = server.accept()
            with served:
                came = b""
                while len(came) < len(hello()):
                    came += served.recv(4096)
                assert came == hello()
                served.sendall(answer)
                assert client.recv(4096) == answer
    entries = load(file)
    assert {it.conn for it in entries} == {1}, "who was turned away was never passed on"
    data = b"".join(it.data or b"" for it in entries)
    assert len(data) == len(hello()) + len(answer)
    assert TOKEN not in data.decode()
