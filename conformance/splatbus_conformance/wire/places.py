"""Where a name or an address is."""

import ipaddress
import socket

Address = tuple[socket.AddressFamily, tuple[str, int] | tuple[str, int, int, int]]


def addresses(host: str, port: int) -> list[Address]:
    """Every place that a name stands for: `localhost` is ::1 and 127.0.0.1. Raises OSError."""
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return [(family, address) for family, _, _, _, address in found]  # type: ignore[misc]


def is_loopback(host: str) -> bool:
    """Whether every address of the host is on this machine only [SEC-1]. Raises OSError."""
    places = [str(address[0]).partition("%")[0] for _, address in addresses(host, 0)]
    return all(ipaddress.ip_address(each).is_loopback for each in places)
