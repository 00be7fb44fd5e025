"""Where a server listens and whom it lets in, from arguments, the environment and defaults."""

from __future__ import annotations

import ipaddress
import os
import socket
from pathlib import Path
from typing import NamedTuple

from splatbus_schemas import FRAMING, LIMITS

_HOST = FRAMING["defaultHost"]
_CHANNELS = FRAMING["channels"]


class Settings(NamedTuple):
    """Where to listen; port 0 lets the system choose.

    Attributes:
        host: a name or an address.
        ipc_port: of the IPC channel.
        message_port: of the message channel.
        token: what a client has to say in its `hello`; None lets everyone in.
    """

    host: str = _HOST["value"]
    ipc_port: int = _CHANNELS["ipc"]["defaultPort"]
    message_port: int = _CHANNELS["message"]["defaultPort"]
    token: str | None = None


def settings(
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    token: str | None = None,
) -> Settings:
    """Fills in what is not given: from SPLATBUS_HOST and its kin, then from the specification.

    Raises:
        ValueError: a port or token is out of its range, or the address can be reached from other
            machines and no token is required [NEG-17].
        OSError: the host's name cannot be resolved.
    """
    chosen = Settings(
        host or os.environ.get(_HOST["environment"]) or _HOST["value"],
        _port("ipc", ipc_port),
        _port("message", message_port),
        token or os.environ.get("SPLATBUS_TOKEN") or None,
    )
    if chosen.token is not None and len(chosen.token) > LIMITS["max_token_chars"]:
        raise ValueError(f"a token has at most {LIMITS['max_token_chars']} characters [NEG-2]")
    if chosen.token is None and not is_loopback(chosen.host):
        raise ValueError(
            f"{chosen.host} can be reached from other machines: require a token "
            "(--token-file, or SPLATBUS_TOKEN), or listen on 127.0.0.1 [NEG-17]"
        )
    return chosen


def read_token(path: Path) -> str:
    """The token in a file, without the white space around it.

    Raises:
        ValueError: it cannot be read, or by others than its owner too, or it holds none.
    """
    try:
        mode, token = path.stat().st_mode, path.read_text("utf-8").strip()
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from None
    if os.name == "posix" and mode & 0o077:
        raise ValueError(f"others than you can read {path}: run chmod 600 {path}")
    if not token:
        raise ValueError(f"{path} holds no token")
    return token


def is_loopback(host: str) -> bool:
    """Whether every address of the host is on this machine only [SEC-1]; OSError if it has none."""
    try:
        addresses = {info[4][0] for info in socket.getaddrinfo(host, None)}
    except socket.gaierror as error:
        raise OSError(error.errno, f"cannot resolve {host}: {error.strerror}") from None
    return all(ipaddress.ip_address(str(a).split("%")[0]).is_loopback for a in addresses)


def listen(host: str, port: int) -> socket.socket:
    """A non-blocking listener; OSError names the address that could not be had."""
    family, _, _, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    try:
        listener = socket.create_server(address[:2], family=family, backlog=16)
    except OSError as error:
        raise OSError(error.errno, f"cannot listen on {host}:{port}: {error.strerror}") from None
    listener.setblocking(False)
    return listener


def _port(channel: str, given: int | None) -> int:
    if given is None:
        name = _CHANNELS[channel]["environment"]
        text = os.environ.get(name) or str(_CHANNELS[channel]["defaultPort"])
        if not text.isdecimal():
            raise ValueError(f"{name} is {text!r}, not a port")
        given = int(text)
    if not 0 <= given <= 65535:
        raise ValueError(f"port {given} is not from 0 to 65535")
    return given
