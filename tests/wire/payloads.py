"""Payloads of messages, and what decoding them is refused for."""

import json

import pytest
from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import PacketDecoder


def payload(message: object) -> bytes:
    return json.dumps(message, ensure_ascii=False).encode()


def payload_of(packet: bytes) -> bytes:
    decoder = PacketDecoder()
    decoder.receive(packet)
    found = decoder.next_packet()
    assert found is not None
    assert decoder.next_packet() is None
    return found


def refusal(decode, *arguments, **keywords) -> ProtocolError:
    with pytest.raises(ProtocolError) as caught:
        decode(*arguments, **keywords)
    return caught.value
