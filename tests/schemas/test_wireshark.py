"""The dissector for Wireshark, tried with tshark over captures."""

import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.recording import Entry, load
from splatbus_schemas.wireshark.__main__ import lua, main, source, tables

from tests.conformance.rules.talk import (
    ASK_CAMERA,
    ASK_SIZE,
    CAMERA,
    HOST_INIT,
    INIT,
    POSE,
    SIZE,
    client,
    frame,
    joined,
    raw,
    server,
    talk,
)
from tests.conformance.wire.capture.writing import pcap, sent

CAPTURES = Path(__file__).parents[1] / "data" / "captures"
TSHARK = shutil.which("tshark")
needs_tshark = pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
MESSAGE = ("splatbus.from", "splatbus.channel", "splatbus.message")


@pytest.fixture(scope="module")
def dissector(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wireshark") / "splatbus.lua"
    assert main(["--output", str(path)]) == 0
    return path


def shown(dissector: Path, capture: Path, *options: str) -> str:
    line = [str(TSHARK), "-X", f"lua_script:{dissector}", "-r", str(capture), *options]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=True)
    assert "Lua Error" not in done.stdout + done.stderr
    return done.stdout


def fields(dissector: Path, capture: Path, *names: str, options: tuple[str, ...] = ()) -> list[Any]:
    """These fields of each frame that has a message, one message a row."""
    asked = [option for name in names for option in ("-e", name)]
    text = shown(dissector, capture, "-Y", "splatbus", "-T", "fields", *asked, *options)
    rows = [[cell.split(",") for cell in line.split("\t")] for line in text.splitlines()]
    return [each for row in rows for each in zip(*row, strict=True)]


def captured(folder: Path, entries: list[Entry], ports: dict[str, int] | None = None) -> Path:
    path = folder / "session.pcap"
    path.write_bytes(pcap(sent(entries, ports) if ports else sent(entries)))
    return path


# What is written


def test_every_message_of_the_metamodel_is_known() -> None:
    names = {each["name"] for each in tables()["messages"]}
    assert {"init_packet", "viewport_size_reply", "camera_pose_reply", "frame", "pong"} <= names
    assert "METAMODEL = nil" not in source()


def test_the_dissector_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    assert capsys.readouterr().out == source()


def test_lua() -> None:
    value = {"a": None, "b c": [True, 1, 0.5], "d": 'say "x" \\'}
    assert lua(value) == '{["b c"] = {true, 1, 0.5}, d = "say \\"x\\" \\\\"}'
    assert lua(["x" * 50, "y" * 50]).splitlines()[1:-1] == [f'  "{c * 50}",' for c in "xy"]


# What tshark shows


@needs_tshark
def test_the_messages_of_the_pair(dissector: Path) -> None:
    said = Counter(
        (it.sender, {"ipc": "ipc", "msg": "message"}[each.channel], it.type or it.kind)
        for each in conversations(load(CAPTURES / "pair.jsonl"))
        for it in each.messages
    )
    assert Counter(fields(dissector, CAPTURES / "pair.pcap", *MESSAGE)) == said


@needs_tshark
def test_members_are_fields(dissector: Path) -> None:
    names = ("splatbus.generation", "splatbus.seq", "splatbus.slot")
    filtered = ("-2", "-R", 'splatbus.message == "frame" && splatbus.seq <= 3')
    found = fields(dissector, CAPTURES / "pair.pcap", *names, options=filtered)
    assert found == [("1", "1", "0"), ("1", "2", "1"), ("1", "3", "0")]
    shown_ = shown(dissector, CAPTURES / "pair.pcap", "-Y", "splatbus.seq == 3 && splatbus.slot")
    assert "SplatBus" in shown_
    assert "frame generation 1 seq 3 slot 0" in shown_


@needs_tshark
def test_messages_without_a_type(dissector: Path, tmp_path: Path) -> None:
    entries = joined(
        talk("ipc", server(INIT)),
        talk("ipc", server(HOST_INIT), conn=2),
        talk("msg", client(ASK_SIZE), server(SIZE), client(ASK_CAMERA), server(CAMERA)),
    )
    assert sorted(fields(dissector, captured(tmp_path, entries), *MESSAGE)) == [
        ("client", "message", "get_camera_pose"),
        ("client", "message", "get_viewport_size"),
        ("server", "ipc", "init_packet"),
        ("server", "ipc", "init_packet"),
        ("server", "message", "camera_pose_reply"),
        ("server", "message", "viewport_size_reply"),
    ]


@needs_tshark
def test_packets_are_cut_and_joined_anywhere(dissector: Path, tmp_path: Path) -> None:
    poses = b"".join(client({**POSE, "note": 'a "b" \\ {[,'}).data or b"" for _ in range(5))
    parts = [poses[:2], poses[2:4], poses[4:300], poses[300:301], poses[301:]]
    path = captured(tmp_path, talk("msg", *[raw("c2s", part) for part in parts]))
    found = fields(dissector, path, "splatbus.message", "splatbus.length", "splatbus.timestamp")
    assert found == [("camera_pose", str(len(poses) // 5 - 4), "12.5")] * 5


@needs_tshark
@pytest.mark.parametrize("header", [b"\0\0\0\0", b"\1\0\x10\0", b"GET / HTTP/1.1\r\n\r\n"])
def test_a_length_that_no_packet_has_is_malformed(
    dissector: Path, tmp_path: Path, header: bytes
) -> None:
    path = captured(tmp_path, talk("msg", client(ASK_SIZE), raw("c2s", header)))
    found = shown(dissector, path, "-Y", "splatbus.bad_length")
    assert "beyond 1 to 1048576 (FRM-2 and FRM-3)" in found
    assert fields(dissector, path, "splatbus.message")[0] == ("get_viewport_size",)


@needs_tshark
def test_what_is_marked(dissector: Path, tmp_path: Path) -> None:
    steps = (
        server({**frame(1), "generation": 0}),
        server(b"[1]"),
        server({"type": "opened", "generation": 1}),
        server({"type": "later"}),
        server(b'{"type": "error", "message": "no", "code": "busy", "id": "x"'),
    )
    path = captured(tmp_path, talk("ipc", *steps))
    text = shown(dissector, path, "-V")
    assert "generation is 0, beyond 1 to any (IMG-1)" in text
    for name, count in {"out_of_range": 1, "not_an_object": 1, "unknown": 2}.items():
        assert shown(dissector, path, "-Y", f"splatbus.{name}").count("\n") == count
    assert "error code busy" in shown(dissector, path)
    assert fields(dissector, path, "splatbus.error.message")[-1] == ("no",)


@needs_tshark
def test_other_ports(dissector: Path, tmp_path: Path) -> None:
    path = captured(tmp_path, talk("msg", client(ASK_SIZE)), {"ipc": 7001, "msg": 7000})
    assert fields(dissector, path, *MESSAGE) == []
    ports = ("-o", "splatbus.ipc_port:7001", "-o", "splatbus.message_port:7000")
    assert fields(dissector, path, *MESSAGE, options=ports) == [
        ("client", "message", "get_viewport_size")
    ]
    decoded = fields(dissector, path, *MESSAGE[::2], options=("-d", "tcp.port==7000,splatbus"))
    assert decoded == [("client", "get_viewport_size")]
