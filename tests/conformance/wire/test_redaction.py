"""Tokens are left out of what is kept: of the same length, in the same form, however they came."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.observe.audit import audit
from splatbus_conformance.wire.packets import Splitter, packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry
from splatbus_conformance.wire.redaction import redacted, restored, stand_in

SECRET = "correct horse battery"
HELLO = {
    "type": "hello",
    "versions": ["1.1"],
    "capabilities": ["token"],
    "client": {"name": "viewer", "version": "1", "token": "no secret"},
    "token": SECRET,
}
TOKENS = st.text(min_size=1, max_size=40)


def stream(payloads: list[bytes], cuts: list[int], direction: Direction = "c2s") -> list[Entry]:
    """One entry for each piece."""
    data = b"".join(map(packet, payloads))
    ends = sorted({*(cut % (len(data) + 1) for cut in cuts), len(data)})
    pieces = [data[a:b] for a, b in zip([0, *ends], ends, strict=False)]
    return [Entry(float(i), "msg", 1, direction, piece) for i, piece in enumerate(pieces)]


def joined(entries: list[Entry]) -> bytes:
    return b"".join(it.data or b"" for it in entries)


def messages(entries: list[Entry]) -> list[dict[str, object]]:
    return [json.loads(it.payload) for it in Splitter().feed(joined(entries), 0.0)]


@given(TOKENS, st.booleans(), st.lists(st.integers(0, 999), max_size=8))
def test_a_hello_keeps_its_form_and_length(token: str, ascii_: bool, cuts: list[int]) -> None:
    text = json.dumps({**HELLO, "token": token}, ensure_ascii=ascii_)
    payload = text.encode("utf-8", "replace")
    given_ = stream([payload, b'{"type": "set_time"}'], cuts)
    found = list(redacted(given_))
    assert [len(it.data or b"") for it in found] == [len(it.data or b"") for it in given_]
    hello, other = messages(found)
    told = hello.pop("token")
    assert isinstance(told, str)
    assert len(told) == len(json.loads(payload)["token"])
    assert {**hello, "token": 0} == {**HELLO, "token": 0}
    assert other == {"type": "set_time"}
    if token.isascii() and token.isprintable() and not {*token} & {'"', "\\"}:
        assert told == stand_in(len(token))
    assert list(redacted(found)) == found, "once is enough"


def test_nothing_of_a_secret_stays() -> None:
    for cut in range(1, 140):
        found = joined(list(redacted(stream([json.dumps(HELLO).encode()], [cut]))))
        assert not {*SECRET.split()} & {*found.decode("utf-8", "replace").split()}
        assert SECRET[:4].encode() not in found


@pytest.mark.parametrize(
    "spelling",
    [
        '{"\\u0074oken": "correct horse battery"}',
        '{"a": {"b": [1, "x\\"{"]}, "token" : "correct horse battery", "c": 1}',
        '{"token": "x", "token": "correct horse battery"}',
        ' {"token":"correct horse battery" ',
    ],
)
def test_a_member_is_found_however_it_is_spelled(spelling: str) -> None:
    for cuts in ([], list(range(99))):
        found = joined(list(redacted(stream([spelling.encode()], cuts))))
        assert b"horse" not in found
        assert len(found) == 4 + len(spelling.encode())


def test_members_of_that_name_elsewhere_and_other_values_stay() -> None:
    nested, number = '{"client": {"token": "mine"}}', '{"token": 5}'
    for text in (nested, number, '["token", "mine"]', '{"a": "token"}'):
        entries = stream([text.encode()], [])
        assert list(redacted(entries)) == entries


@pytest.mark.parametrize("channel", ["ipc", "msg"])
@pytest.mark.parametrize("direction", ["c2s", "s2c"])
def test_a_token_that_comes_back_is_left_out_too(channel: Channel, direction: Direction) -> None:
    said = {"type": "error", "message": f"{SECRET!r} is wrong, {SECRET} is"}
    whole = packet(json.dumps(said).encode())
    for cut in range(len(whole)):
        pieces = [Entry(9.0, channel, 2, direction, it) for it in (whole[:cut], whole[cut:]) if it]
        found = list(redacted([*stream([json.dumps(HELLO).encode()], []), *pieces]))[1:]
        assert len(joined(found)) == len(whole)
        text = joined(found)[4:].decode()
        assert SECRET[3:] not in text
        assert "battery" not in text
        assert json.loads(text).keys() == said.keys()


def test_what_came_in_single_bytes_loses_all_but_its_first() -> None:
    pieces = [Entry(9.0, "msg", 2, "s2c", bytes([it])) for it in packet(SECRET.encode())]
    found = list(redacted([*stream([json.dumps(HELLO).encode()], []), *pieces]))[1:]
    assert joined(found)[4:] == SECRET[:3].encode() + stand_in(len(SECRET))[3:].encode()


def test_short_tokens_are_left_out_of_a_hello_alone() -> None:
    hello = json.dumps({**HELLO, "token": "message"}).encode()
    answer = Entry(9.0, "msg", 1, "s2c", packet(b'{"message": "a message"}'))
    first, second = redacted([*stream([hello], []), answer])
    assert messages([first])[0]["token"] == "redacte"
    assert second == answer


def test_what_is_behind_a_header_that_is_none_stays_as_it_is() -> None:
    data = b'\xff\xff\xff\xff{"token": "mine"}'
    entries = [Entry(0.0, "msg", 1, "c2s", data)]
    assert list(redacted(entries)) == entries


def test_rules_find_the_same_in_what_is_left() -> None:
    hello = json.dumps({**HELLO, "token": "é" * 256, "versions": [1]}).encode()
    entries = stream([hello], [9])
    broken = [
        [it.requirement.id for it in audit(each).findings if it.broken]
        for each in (entries, redacted(entries))
    ]
    assert broken[0] == broken[1]
    assert "NEG-2" in broken[0]


@pytest.mark.parametrize(
    "token", ["short", "of quite another length than the one that was left out", 'a"b']
)
def test_another_token_takes_the_place_of_one_that_was_left_out(token: str) -> None:
    payloads = [json.dumps(HELLO).encode(), b'{"type": "set_time"}']
    found, lacking = restored(redacted(stream(payloads, [])), token)
    assert lacking == 0
    assert messages(found) == [{**HELLO, "token": token}, {"type": "set_time"}]


def test_what_lacks_a_token_is_counted() -> None:
    hello = json.dumps(HELLO).encode()
    for given_, token in ((stream([hello], []), ""), (stream([hello], [9]), "mine")):
        kept = list(redacted(given_))
        assert restored(kept, token) == (kept, 1)
    assert restored(stream([hello], []), "mine") == (stream([hello], []), 0), "it has its own"
