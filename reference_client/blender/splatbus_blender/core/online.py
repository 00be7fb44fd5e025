"""Whether a server is on this computer: others are met only where Blender may go online."""

from __future__ import annotations

import ipaddress


def is_this_computer(host: str) -> bool:
    """Whether a name or an address is one of this computer for sure; nothing is looked up."""
    if host.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
