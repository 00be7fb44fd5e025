"""Tokens are left out of what is kept: of the same length, in the same form, however they came."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
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
CUTS = st.lists(st.integers(0, 999), max_size=8)


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


@given(st.just(SECRET) | st.text(min_size=1, max_size=40), st.booleans(), CUTS)
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
    if token == SECRET:
        assert told == stand_in(len(token))
    assert list(redacted(found)) == found, "once is enough"


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


@given(st.sampled_from(["ipc", "msg"]), st.sampled_from(["c2s", "s2c"]), CUTS)
def test_a_token_that_comes_back_is_left_out_too(
    channel: Channel, direction: Direction, cuts: list[int]
) -> None:
    """But for its first letters, where they come by themselves."""
    said = json.dumps({"type": "error", "message": f"{SECRET!r} is wrong, {SECRET} is"}).encode()
    answer = [it._replace(channel=channel, conn=2) for it in stream([said], cuts, direction)]
    told = joined([*redacted([*stream([json.dumps(HELLO).encode()], []), *answer])][1:])
    assert len(told) == len(packet(said))
    assert SECRET[3:].encode() not in told
    assert json.loads(told[4:]).keys() == {"type", "message"}


def test_short_tokens_are_left_out_of_a_hello_alone() -> None:
    hello = json.dumps({**HELLO, "token": "message"}).encode()
    answer = Entry(9.0, "msg", 1, "s2c", packet(b'{"message": "a message"}'))
    first, second = redacted([*stream([hello], []), answer])
    assert messages([first])[0]["token"] == "redacte"
    assert second == answer


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
