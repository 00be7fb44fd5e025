"""Where a server listens and whom it lets in."""

from __future__ import annotations

import errno
import ipaddress
import socket

from splatbus_schemas.first_bytes import recognised
from splatbus_schemas.visible import visible
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.messages import Hello, Program, Welcome, decode_from_server_ipc, encode
from splatbus_wire.packet_reader import PacketReader
from splatbus_wire.settings import Settings
from splatbus_wire.settings import settings as wire_settings

BACKLOG = 4096
"""Connections that the system keeps until they are accepted, as far as it lets us."""
ASK_SECONDS, MOST_READS, MOST_READ = 1.0, 3, 4096
"""Of what listens where this server was to listen: for each step; looks at its answer, and bytes
for each.
"""
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
        why = error.strerror
        if error.errno == errno.EADDRINUSE:
            why = f"{who_listens(*address[:2])}; choose other ports, or stop it"
        raise OSError(error.errno, f"cannot listen on {host}:{port}: {why}") from None
    listener.setblocking(False)
    return listener


def who_listens(host: str, port: int) -> str:
    """What answers there when it is greeted, in words; it has a few seconds at most."""
    reader, said, payload, other = PacketReader(), b"", None, "another program listens there"
    hello = Hello(("1.1", "1.0"), Program("splatbus-server", ""), ())
    try:
        with socket.create_connection((host, port), ASK_SECONDS) as asked:
            asked.sendall(encode(hello))
            asked.shutdown(socket.SHUT_WR)
            for _ in range(MOST_READS):
                said = asked.recv(MOST_READ)
                reader.receive(said, 0.0)
                payload = reader.next_packet(0.0)
                if payload is not None or not said:
                    break
        message = decode_from_server_ipc(payload or b"")
    except FramingError:
        known = recognised(said)
        return other + f" ({known})" * bool(known)
    except (OSError, ProtocolError):
        return other
    name = visible(" ".join(message.server)) if isinstance(message, Welcome) else "of SplatBus"
    return f"another server listens there, {name}"
