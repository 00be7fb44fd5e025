from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.peers.raw_client import RawClient, Reader

SECONDS = 30
COMMAND = [sys.executable, "-m", "splatbus_renderer.cli"]
READY = re.compile(
    r"splatbus-server ready on (\S+): IPC port (\d+), message port (\d+), (\d+)x(\d+)\n"
)
ENVIRONMENT = {name: value for name, value in os.environ.items() if "SPLATBUS" not in name}


class Running(NamedTuple):
    process: subprocess.Popen[str]
    ipc_port: int
    message_port: int

    def end(self, number: int) -> tuple[int, str]:
        """Exit code and log."""
        self.process.send_signal(number)
        _, log = self.process.communicate(timeout=SECONDS)
        return self.process.returncode, log


@contextmanager
def running(*options: str, **environment: str) -> Iterator[Running]:
    ports = () if environment else ("--ipc-port", "0", "--msg-port", "0")
    process = subprocess.Popen(
        [*COMMAND, "--size", "32x24", *ports, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**ENVIRONMENT, **environment},
    )
    assert process.stdout is not None
    try:
        match = READY.fullmatch(line := process.stdout.readline())
        assert match, line
        yield Running(process, int(match[2]), int(match[3]))
    finally:
        process.kill()
        process.communicate()


def refused(*options: str) -> tuple[int, str]:
    """Exit code and message of a server that does not start."""
    result = subprocess.run(
        [*COMMAND, *options],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        env=ENVIRONMENT,
        check=False,
    )
    assert "Traceback" not in result.stderr
    return result.returncode, result.stderr


def test_help_teaches() -> None:
    text = subprocess.run([*COMMAND, "--help"], capture_output=True, text=True, check=True).stdout
    for word in ("examples:", "SPLATBUS_TOKEN", "what next:", "exit codes:", "--token-file"):
        assert word in text


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_cleanly(number: int) -> None:
    with running() as server:
        with RawClient(server.message_port) as client:
            assert client.viewport() == [32, 24]
            code, log = server.end(number)
            assert client.receive() is None
        assert code == 0, log
        assert "stopped" in log
        assert "Traceback" not in log


def test_a_turntable_turns_without_anybody_moving_it() -> None:
    """Where the environment says that it listens."""
    environment = {"SPLATBUS_IPC_PORT": "0", "SPLATBUS_MSG_PORT": "0", "SPLATBUS_TOKEN": "secret"}
    options = ("--turntable", "90", "--fps", "200")
    with (
        running(*options, **environment) as server,
        Reader(server.ipc_port, token="secret") as reader,
    ):
        reader.open()
        images = []
        for _ in range(3):
            frame = reader.frame()
            images.append(reader.color(frame).copy())
            reader.release(frame)
    assert (images[0] != images[2]).any()


def test_what_it_cannot_serve_it_explains(tmp_path: Path) -> None:
    """[NEG-17]: wrong usage by exit code 2, what is taken or not there by 1."""
    path, ports = tmp_path / "token", ("--ipc-port", "0", "--msg-port", "0")
    path.write_text("secret")
    path.chmod(0o644)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        for options, code, words in (
            (("--host", "0.0.0.0", *ports), 2, "--token-file.*NEG-17"),
            (("--token-file", str(path), *ports), 2, "chmod 600"),
            (("--token-file", str(tmp_path / "none")), 2, f"cannot read {tmp_path / 'none'}"),
            (("--size", "huge"), 2, "'huge': give a size such as"),
            (("--size", "0x3"), 2, "1 to 32768 pixels"),
            (("--turntable", "nan"), 2, "from -1000000 to 1000000, such as 20"),
            (("--ipc-port", "-1"), 2, "give a port from 0 to 65535, such as 6001"),
            (("--host", "nowhere.invalid"), 1, "cannot resolve nowhere.invalid"),
            (("--ipc-port", "0", "--msg-port", port), 1, port),
        ):
            found, message = refused(*options)
            assert (found, re.search(words, message, re.S) is not None) == (code, True), message
