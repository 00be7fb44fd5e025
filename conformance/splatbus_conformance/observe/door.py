"""Who may come in: where other machines can connect to the proxy, it asks for the server's token.

A server behind it that listens on loopback may require none, and the proxy would open it to all.
"""

import hmac
from collections.abc import Callable
from dataclasses import dataclass

from splatbus_conformance.wire.json_reading import read
from splatbus_conformance.wire.packets import HEADER, is_length
from splatbus_conformance.wire.recording import Channel

MOST_HELLO = 65536
"""Bytes of a message that nobody has let in yet."""


@dataclass(frozen=True)
class Door:
    """What a client has to say first, and who is told of one that does not."""

    token: str
    refused: Callable[[Channel], None]

    def opens(self, said: bytes) -> bool | None:
        """Whether to let in who has said this so far; None while it may still become right."""
        if len(said) < HEADER:
            return None
        length = int.from_bytes(said[:HEADER], "little")
        if length > MOST_HELLO or not is_length(length):
            return False
        if len(said) < HEADER + length:
            return None
        hello = read(said[HEADER : HEADER + length]).value or {}
        token = hello.get("token")
        if hello.get("type") != "hello" or not isinstance(token, str):
            return False
        given, wanted = (it.encode("utf-8", "surrogatepass") for it in (token, self.token))
        return hmac.compare_digest(given, wanted)
