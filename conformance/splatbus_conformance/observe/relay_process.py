"""The relay in a process of its own, so that nobody's work delays what passes."""

import contextlib
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from splatbus_schemas.visible import visible

from splatbus_conformance.observe.door import Door
from splatbus_conformance.observe.relay import Relay
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.wire.places import addresses, is_loopback
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.saving import Recorder
from splatbus_conformance.wire.secrets import TOKEN_VARIABLE, own_token
from splatbus_conformance.wire.sockets import CHANNELS

START_SECONDS = 10.0
READY = "ready"
LEAST_TOKEN = 16
ANOTHER = "does something listen there? --listen names other ports"


class Endpoint(NamedTuple):
    """Where both channels are."""

    host: str
    ipc: int
    msg: int

    def __str__(self) -> str:
        return f"{f'[{self.host}]' if ':' in self.host else self.host}:{self.ipc},{self.msg}"

    def place(self, channel: Channel) -> str:
        """As people write it."""
        host, port = self.at(channel)
        return f"{host}:{port}"

    def at(self, channel: Channel) -> tuple[str, int]:
        """Host and port of one channel."""
        return self.host, self.ipc if channel == "ipc" else self.msg


def endpoint(text: str) -> Endpoint:
    """`HOST:IPC,MSG`. Raises Usage."""
    host, _, ports = text.rpartition(":")
    try:
        ipc, msg = (int(port) for port in ports.split(","))
        if not all(0 < port < 65536 for port in (ipc, msg)):
            raise ValueError(text)
    except ValueError:
        raise Usage(
            f"{text!r} is not HOST:IPC,MSG, such as 127.0.0.1:6001,6000, or [::1]:6001,6000"
        ) from None
    if ipc == msg:
        raise Usage(f"{text}: IPC and message need a port each, such as 127.0.0.1:6001,6000")
    return Endpoint(host.strip("[]") or "127.0.0.1", ipc, msg)


class Relayed:
    """A relay that runs.

    Attributes:
        warnings: what it has said since it began, in the order of time.
    """

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.warnings: list[str] = []
        self._process = process
        threading.Thread(target=self._listen, daemon=True).start()

    @property
    def runs(self) -> bool:
        """It has not ended."""
        return self._process.poll() is None

    def _listen(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self.warnings.append(line.rstrip())


@contextlib.contextmanager
def relayed(listen: Endpoint, to: Endpoint, file: Path) -> Iterator[Relayed]:
    """A relay beside this process, which writes what passes into `file`.

    Raises:
        Usage: an address cannot be listened on, a host is unknown, or the file not be written.
        NoVerdict: it does not start.
    """
    module = [sys.executable, "-m", "splatbus_conformance.observe.relay_process", str(file)]
    with subprocess.Popen(
        [*module, str(listen), str(to)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    ) as process:
        assert process.stdout
        said = process.stdout.readline().strip()
        if said != READY:
            _, problem = process.communicate(timeout=START_SECONDS)
            reason = problem.strip().splitlines()[-1:] or ["it ended without a word"]
            raise Usage(said) if said else NoVerdict(f"the relay does not start: {reason[0]}")
        try:
            yield Relayed(process)
        finally:
            assert process.stdin
            process.stdin.close()
            process.wait(START_SECONDS)


class _Notes:
    """Writes what passes; if that fails, says so once, and the session goes on. Raises OSError."""

    def __init__(self, file: Path) -> None:
        self._file: Recorder | None = Recorder(file)

    def note(self, entry: Entry) -> None:
        """Take what has passed."""
        if self._file is not None:
            try:
                self._file.note(entry)
            except OSError as error:
                self._file = None
                _say(f"what passes from {entry.t:.3f} s on is not recorded: {error.strerror}")


def main(arguments: list[str]) -> None:
    """Listen, dial and record: `… relay_process FILE HOST:IPC,MSG HOST:IPC,MSG`, to listen and to.

    Says `ready` or why not, then what its user should know; ends when its standard input does.
    """
    # A user's Ctrl-C is for the process that started this one, which then ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    file, listen, to = arguments[0], endpoint(arguments[1]), endpoint(arguments[2])
    try:
        token = _required_token(listen.host)
    except (OSError, ValueError) as error:
        _say(str(error))
        return
    listeners: dict[Channel, socket.socket] = {}
    for channel in CHANNELS:
        try:
            listeners[channel] = listener(*listen.at(channel))
        except OSError as error:
            _say(f"cannot listen on {listen.place(channel)}: {error.strerror}; {ANOTHER}")
            return
    try:
        notes = _Notes(Path(file))
    except OSError as error:
        _say(f"cannot write {file}: {error.strerror}; --record names another file")
        return

    def missed(channel: Channel, reason: str) -> None:
        _say(
            f"a client came to the {channel} channel, but there is no server at "
            f"{to.place(channel)} ({reason}): start it, or say with --to where it is"
        )

    def refused(channel: Channel) -> None:
        _say(
            f"a client on the {channel} channel was turned away: its first message was no `hello` "
            f"with the token of {TOKEN_VARIABLE}"
        )

    servers = {channel: to.at(channel) for channel in CHANNELS}
    door = None if token is None else Door(token, refused)
    try:
        relay = Relay(listeners, servers, notes.note, missed, door)
    except OSError as error:
        _say(f"--to: no host {to.host!r} is known: {error.strerror}")
        return

    def stop_at_end_of_input() -> None:
        sys.stdin.read()
        relay.stop()

    threading.Thread(target=stop_at_end_of_input, daemon=True).start()
    _say(READY)
    relay.run()


def _required_token(host: str) -> str | None:
    """What clients have to say where others than this machine can connect, as to a server [NEG-17].

    Raises ValueError where none is named, or one that could be guessed; OSError for no host.
    """
    try:
        if is_loopback(host):
            return None
    except socket.gaierror as error:
        raise OSError(f"cannot listen on {host}: {error.strerror}; {ANOTHER}") from None
    token = own_token()
    if len(token) < LEAST_TOKEN:
        raise ValueError(
            f"{host} can be reached from other machines: put the server's token, of at least "
            f"{LEAST_TOKEN} characters, into {TOKEN_VARIABLE}, or listen on 127.0.0.1 [NEG-17]"
        )
    return token


def listener(host: str, port: int) -> socket.socket:
    """A socket that listens there. Raises OSError."""
    [(family, address), *_] = addresses(host, port)
    return socket.create_server(address[:2], family=family)


def _say(text: str) -> None:
    print(visible(text), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
