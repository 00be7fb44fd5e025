"""Where a server listens and whom it lets in."""

from __future__ import annotations

import ipaddress
import socket

from splatbus_wire.settings import Settings
from splatbus_wire.settings import settings as wire_settings

BACKLOG = 4096
"""Connections that the system keeps until they are accepted, as far as it lets us."""
LEAST_TOKEN_CHARS = 16
"""Of a token that others can try: with fewer it could be guessed."""


def settings(
    host: str | None = None,
    ipc_port: int | None = None,
    message_port: int | None = None,
    token: str | None = None,
) -> Settings:
    """As `splatbus_wire.settings`; port 0 lets the system choose.

    Raises:
        ValueError: a port or token is out of its range, or the address can be reached from other
            machines and no token is required, or a short one [NEG-17].
        OSError: the host's name cannot be resolved.
    """
    chosen = wire_settings(host, ipc_port, message_port, token, least_port=0)
    if is_loopback(chosen.host):
        return chosen
    if chosen.token is None:
        raise ValueError(
            f"{chosen.host} can be reached from other machines: require a token "
            "(--token-file, or SPLATBUS_TOKEN), or listen on 127.0.0.1 [NEG-17]"
        )
    if len(chosen.token) < LEAST_TOKEN_CHARS:
        raise ValueError(
            f"{chosen.host} can be reached from other machines, and a token of fewer than "
            f"{LEAST_TOKEN_CHARS} characters can be guessed; one that cannot: "
            "python -c 'import secrets; print(secrets.token_urlsafe())'"
        )
    return chosen


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
        listener = socket.create_server(address[:2], family=family, backlog=BACKLOG)
    except OSError as error:
        raise OSError(error.errno, f"cannot listen on {host}:{port}: {error.strerror}") from None
    listener.setblocking(False)
    return listener
