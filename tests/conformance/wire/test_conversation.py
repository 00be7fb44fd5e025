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


def test_numbers_written_as_strings_are_taken_and_noted() -> None:
    (found,) = conversations(talk("msg", client(ASK_SIZE), server({"viewport_size": ["64", 48]})))
    reply = found.messages[1]
    assert reply.value == {"viewport_size": [64, 48]}
    assert reply.kind == "viewport_size"
    assert [(f.requirement, f.pointer) for f in reply.faults] == [("JSN-4", "/viewport_size/0")]


def test_ends_and_resets() -> None:
    (found,) = conversations(talk("msg", CLIENT_ENDS, ends("s2c", "reset"), CLIENT_ENDS))
    assert list(found.ended) == ["c2s", "s2c"]
    assert found.ended["c2s"] == 1.01
    assert found.resets == {"s2c"}


def test_a_message_is_placed_by_what_came_before_it() -> None:
    steps = (client(POSE), client(hello()), client(POSE), server(welcome()), server(SIZE))
    (found,) = conversations(talk("msg", *steps))
    assert [(m.kind, h is not None, w is not None) for m, h, w in found.placed()] == [
        ("camera_pose", False, False),
        ("hello", False, False),
        ("camera_pose", True, False),
        ("welcome", True, False),
        ("viewport_size", True, True),
    ]
    assert found.hello is found.messages[1]
    assert found.welcome is found.messages[3]


def test_messages_of_some_kinds_stay_in_order() -> None:
    steps = (client(POSE), client(ASK_SIZE), server(SIZE), client(b"{}"), client(POSE))
    (found,) = conversations(talk("msg", *steps))
    first, asked, told, _, last = found.messages
    assert list(found.of("viewport_size", "camera_pose")) == [first, told, last]
    assert [each.message for each in found.placed("get_viewport_size")] == [asked]
    assert not found.of("frame")


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


def test_hello_from_a_server_and_welcome_from_a_client_mean_nothing() -> None:
    (found,) = conversations(talk("msg", server(hello()), client(welcome())))
    assert found.hello is None
    assert found.welcome is None


def test_what_is_no_object_has_no_type() -> None:
    (found,) = conversations(talk("msg", client(b"[]"), client({"type": 5})))
    assert [(m.value, m.type, m.kind) for m in found.messages] == [
        (None, None, None),
        ({"type": 5}, None, None),
    ]
