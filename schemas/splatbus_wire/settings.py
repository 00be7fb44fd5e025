"""Where the two channels are, and the token: from arguments, the environment and the specification.

Source: 1.0 section 3.1 [CHN-2], 1.1 section 2.4 [NEG-2, NEG-21].
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from splatbus_schemas import FRAMING, LIMITS

_HOST = FRAMING["defaultHost"]
_CHANNELS = FRAMING["channels"]

TOKEN_VARIABLE = "SPLATBUS_TOKEN"


class Settings(NamedTuple):
    """Where a server is, or is to be.

    Attributes:
        host: a name or an address.
        ipc_port: of the IPC channel.
        message_port: of the message channel.
        token: what a `hello` has to say; None for none.
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
    *,
    least_port: int = 1,
    environment: Mapping[str, str] = os.environ,
) -> Settings:
    """Fill in what is not given: from SPLATBUS_HOST and its kin, then from the specification.

    Args:
        least_port: 0 where the system may choose one, as for a server.

    Raises:
        ValueError: a port or the token is out of its range, the token is no text, or both ports are
            one; the message names the variable that it came from, if it did.
    """
    token = token or environment.get(TOKEN_VARIABLE) or None
    if token is not None and len(token) > LIMITS["max_token_chars"]:
        raise ValueError(f"a token has at most {LIMITS['max_token_chars']} characters [NEG-2]")
    try:
        (token or "").encode()
    except UnicodeEncodeError:
        raise ValueError("the token is not UTF-8 [NEG-2]") from None
    chosen = Settings(
        host or environment.get(_HOST["environment"]) or _HOST["value"],
        _port(ipc_port, _CHANNELS["ipc"], environment, least_port),
        _port(message_port, _CHANNELS["message"], environment, least_port),
        token,
    )
    if chosen.ipc_port == chosen.message_port != 0:
        raise ValueError(
            f"both channels have port {chosen.ipc_port}: each has one of its own, such as "
            f"{_CHANNELS['ipc']['defaultPort']} (IPC) and {_CHANNELS['message']['defaultPort']} "
            "(message) [CHN-1]"
        )
    return chosen


def read_token(path: Path) -> str:
    """The token in a file, without the white space around it [NEG-21].

    Raises:
        ValueError: the file cannot be read, or by others than its owner too, or it holds none.
    """
    try:
        mode, token = path.stat().st_mode, path.read_text("utf-8").strip()
    except OSError as error:
        raise ValueError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not UTF-8 [NEG-2]") from None
    if os.name == "posix" and mode & 0o077:
        raise ValueError(f"others than you can read {path}: run chmod 600 {path} [NEG-21]")
    if not token:
        raise ValueError(f"{path} holds no token")
    return token


def _port(
    given: int | None, channel: Mapping[str, Any], environment: Mapping[str, str], least: int
) -> int:
    variable = channel["environment"]
    text = environment.get(variable) or str(channel["defaultPort"])
    if given is not None:
        variable, text = "the port", str(given)
    if not text.isascii() or not text.isdecimal() or not least <= int(text) <= 65535:
        raise ValueError(f"{variable} is {text!r}, not a number from {least} to 65535 [CHN-2]")
    return int(text)
