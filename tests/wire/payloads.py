"""Payloads of messages, and what decoding them is refused for."""

import json

import pytest
from hypothesis import strategies as st
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


def with_value(message: dict, pointer: str, value: object) -> dict:
    """The message with `value` where the pointer leads, or with nothing there for `...`."""
    changed = json.loads(json.dumps(message))
    *path, last = pointer[1:].split("/")
    place = changed
    for name in path:
        place = place[int(name) if isinstance(place, list) else name]
    if value is ...:
        del place[last]
    else:
        place[int(last) if isinstance(place, list) else last] = value
    return changed


def refusal(decode, *arguments, **keywords) -> ProtocolError:
    with pytest.raises(ProtocolError) as caught:
        decode(*arguments, **keywords)
    return caught.value


@st.composite
def edited(draw: st.DrawFn, *payloads: bytes) -> bytes:
    """One of these with a few of its bytes cut, doubled, or replaced."""
    payload = draw(st.sampled_from(payloads))
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(payload)))
        end = start + draw(st.integers(0, 12))
        new = draw(
            st.just(b"")
            | st.just(payload[start:end] * 2)
            | st.text('0123456789eE.+-"{}[]:, \n\\xyzw', max_size=4).map(str.encode)
        )
        payload = payload[:start] + new + payload[end:]
    return payload
