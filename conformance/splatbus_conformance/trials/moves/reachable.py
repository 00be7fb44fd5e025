"""Where a server of this machine can be reached, of all addresses that the machine has."""

import socket

from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.places import is_loopback

ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
"""Addresses for documentation: the way to them begins at this machine's own address, and nothing is
sent there."""


def addresses() -> list[str]:
    """This machine's own addresses on the way to others, without loopback."""
    found = []
    for family, elsewhere in ELSEWHERE.items():
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as sock:
                sock.connect((elsewhere, 9))
                found.append(str(sock.getsockname()[0]))
        except OSError:
            continue
    return [each for each in found if not is_loopback(each)]


def accepts(address: str, port: int) -> bool:
    """Whether something accepts a connection there."""
    try:
        socket.create_connection((address, port), EFFECT_SECONDS).close()
    except OSError:
        return False
    return True
