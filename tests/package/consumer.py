"""A program of somebody who uses the installed packages; a type checker reads it, nothing runs it.

Each `type: ignore` is a mistake that a checker must see: where it sees none, it complains.
"""

from collections.abc import Mapping
from typing import assert_type

from splatbus_client import FrameLease, Session, connect
from splatbus_conformance.verdicts import Level
from splatbus_schemas import Requirement, requirements
from splatbus_server import Bus, View, serve
from splatbus_wire.framing import PacketDecoder, encode_packet
from splatbus_wire.poses import Pose


def speak(payload: bytes) -> bytes | None:
    decoder = PacketDecoder()
    decoder.receive(encode_packet(payload))
    encode_packet("a string")  # type: ignore[arg-type]
    return decoder.next_packet()


def look() -> None:
    with connect("127.0.0.1", 6001, 6000) as session:
        assert_type(session, Session)
        connect(port=6000)  # type: ignore[call-arg]


def render() -> None:
    with serve(64, 48) as bus:
        assert_type(bus, Bus)
        assert_type(bus.next_view(timeout=0.1), View | None)


assert_type(requirements("1.0"), Mapping[str, Requirement])
level: Level = Level.WIRE
pose: Pose = "not a pose"  # type: ignore[assignment]
lease: type[FrameLease] = FrameLease
