"""Conversations are put together from a recording's lines."""

from splatbus_conformance.wire.conversation import Assembler, conversations
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    POSE,
    SIZE,
    client,
    ends,
    hello,
    joined,
    server,
    talk,
    text,
    welcome,
)


def test_connections_are_kept_apart_and_in_order() -> None:
    recording = joined(
        talk("msg", client(POSE), start=2.0),
        talk("ipc", server({}), start=1.0),
        talk("msg", client(ASK_SIZE), conn=2, start=3.0),
    )
    found = conversations(recording)
    assert [(c.channel, c.number, c.opened) for c in found] == [
        ("ipc", 1, 1.0),
        ("msg", 1, 2.0),
        ("msg", 2, 3.0),
    ]
    assert [c.messages[0].value for c in found] == [{}, POSE, ASK_SIZE]
    assert all(c.beside == found for c in found)


def test_directions_are_split_apart() -> None:
    asked, told = packet(text(ASK_SIZE)), packet(text(SIZE))
    entries = [
        Entry(1.0, "msg", 1, "c2s", asked[:9]),
        Entry(2.0, "msg", 1, "s2c", told[:3]),
        Entry(3.0, "msg", 1, "c2s", asked[9:]),
        Entry(4.0, "msg", 1, "s2c", told[3:]),
    ]
    (found,) = conversations(entries)
    assert [(m.sender, m.value, m.packet.ended) for m in found.messages] == [
        ("client", ASK_SIZE, 3.0),
        ("server", SIZE, 4.0),
    ]
    assert [m.value for m in found.sent_by("server")] == [SIZE]


def test_a_message_is_placed_by_what_came_before_it() -> None:
    """A hello from a server and a welcome from a client mean nothing."""
    strange = (server(hello()), client(welcome()))
    steps = (client(POSE), *strange, client(hello()), client(POSE), server(welcome()), server(SIZE))
    (found,) = conversations(talk("msg", *steps, ends("s2c", "reset"), CLIENT_ENDS, CLIENT_ENDS))
    assert [(h is not None, w is not None) for _, h, w in found.placed()] == [
        *[(False, False)] * 4,
        *[(True, False)] * 2,
        (True, True),
    ]
    assert found.hello is found.messages[3]
    assert found.welcome is found.messages[5]
    assert (list(found.ended), found.resets) == (["s2c", "c2s"], {"s2c"})


def test_a_copy_stays_as_it_is_while_more_is_fed() -> None:
    assembler = Assembler()
    entries = talk("msg", client(hello()), server(welcome()), CLIENT_ENDS)
    for entry in entries[:2]:
        assembler.feed(entry)
    (copy,) = assembler.so_far()
    for entry in entries[2:]:
        assembler.feed(entry)
    (grown,) = assembler.so_far()
    assert (copy.welcome, len(copy.messages), copy.ended) == (None, 1, {})
    assert grown.welcome is grown.messages[1]
    assert list(grown.ended) == ["c2s"]
