"""Whom to connect to and with which token: from arguments, the environment and defaults."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from splatbus_schemas import FRAMING, LIMITS

_HOST = FRAMING["defaultHost"]
_CHANNELS = FRAMING["channels"]

TOKEN_VARIABLE = "SPLATBUS_TOKEN"


class Settings(NamedTuple):
    """Where a server is.

    Attributes:
        host: a name or an address.
        ipc_port: of its IPC channel, 1 to 65535.
        message_port: of its message channel, 1 to 65535.
        token: what to say in `hello`; None says nothing.
    """

    host: str
    ipc_port: int
    message_port: int
    token: str | None

    def address(self) -> str:
        """Host and both ports, for people."""
        return f"{self.host}, ports {self.ipc_port} (IPC) and {self.message_port} (message)"


def settings(
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    token: str | None = None,
    environment: Mapping[str, str] = os.environ,
) -> Settings:
    """Fill in what is not given: from SPLATBUS_HOST and its kin, then from the specification.

    Raises:
        ValueError: a port or the token is out of its range; the message names the variable that
            it came from, if it did.
    """
    token = token or environment.get(TOKEN_VARIABLE) or None
    if token is not None and len(token) > LIMITS["max_token_chars"]:
        raise ValueError(f"a token has at most {LIMITS['max_token_chars']} characters [NEG-2]")
    return Settings(
        host or environment.get(_HOST["environment"]) or _HOST["value"],
        _port(ipc_port, _CHANNELS["ipc"], environment),
        _port(message_port, _CHANNELS["message"], environment),
        token,
    )


def read_token(path: Path) -> str:
    """Return the token in a file, without the white space around it [NEG-21].

    Raises:
        ValueError: the file holds none, or others than its owner can read it.
        OSError: it cannot be read.
    """
    if os.name == "posix" and path.stat().st_mode & 0o077:
        raise ValueError(f"others than you can read {path}: run chmod 600 {path} [NEG-21]")
    token = path.read_text("utf-8").strip()
    if not token:
        raise ValueError(f"{path} holds no token")
    return token


def _port(given: int | None, channel: Mapping[str, object], environment: Mapping[str, str]) -> int:
    variable = str(channel["environment"])
    text = environment.get(variable) or str(channel["defaultPort"])
    if given is not None:
        variable, text = "the port", str(given)
    if not text.isascii() or not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise ValueError(f"{variable} is {text!r}, not a number from 1 to 65535 [CHN-2]")
    return int(text)
