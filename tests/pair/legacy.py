"""Clients of 1.0, as they are deployed: what was never written down is what they do."""

from __future__ import annotations

import json
import socket
import struct
from pathlib import Path
from typing import Any

from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.recording import load

from tests.pair.rig import MOST_SECONDS, Tap
from tests.peers.raw_client import packet

RECORDINGS = Path(__file__).parents[1] / "data" / "recordings"


def replay(name: str, tap: Tap) -> list[dict[str, Any]]:
    """Say what a deployed client once said on its message channel; the replies to that.

    It waits for a reply where it was sent one then.
    """
    [recorded] = [c for c in conversations(load(RECORDINGS / name)) if c.channel == "msg"]
    replies: list[dict[str, Any]] = []
    address = ("127.0.0.1", tap.ports["msg"])
    with socket.create_connection(address, timeout=MOST_SECONDS) as connection:
        stream = connection.makefile("rb")
        for message in recorded.messages:
            payload = message.packet.payload
            if message.sender == "client":
                connection.sendall(packet(payload))
            else:
                (length,) = struct.unpack("<I", stream.read(4))
                replies.append(json.loads(stream.read(length)))
        connection.shutdown(socket.SHUT_WR)
        assert stream.read() == b"", "more was sent than was asked for"
        stream.close()
    return replies
