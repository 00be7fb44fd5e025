"""Every rule on JSON text, kept and broken, for both peers."""

from splatbus_conformance.wire.recording import Entry
from splatbus_schemas import LIMITS

from tests.conformance.rules.talk import ASK_SIZE, SIZE, Case, breaches, client, server, talk

KEPT = talk("msg", client(ASK_SIZE), server(SIZE))
BROKEN = {
    "JSN-1": b"[%s]",
    "JSN-2": b"\xef\xbb\xbf%s",
    "JSN-3": b'{"a":1,"a":2,%s',
    "JSN-4": b'{"a":NaN,%s',
    "JSN-5": b'{"a":' + b"[" * 64 + b"]" * 64 + b",%s",
    "JSN-12": b'{"a":[' + b"0," * LIMITS["max_server_values"] + b"0],%s",
}


def spoiled(template: bytes, message: bytes) -> bytes:
    return template.replace(b"%s", message[1:] if template.startswith(b"{") else message)


def says(peer: str, template: bytes) -> list[Entry]:
    if peer == "client":
        return talk("msg", client(spoiled(template, b'{"type":"get_viewport_size"}')))
    return talk("msg", client(ASK_SIZE), server(spoiled(template, b'{"viewport_size":[64,48]}')))


CASES = [
    Case(requirement, peer, KEPT, says(peer, template))
    for requirement, template in BROKEN.items()
    for peer in ("client", "server")
]


def test_one_message_breaks_a_requirement_once_however_often_it_does() -> None:
    twice = says("client", b'{"a":NaN,"b":1e400,"c":-Infinity,%s')
    assert breaches(twice) == {("client", "JSN-4"): 1}


def test_as_many_values_as_there_may_be_are_allowed() -> None:
    # The object, its type, the array; names are no values, nor are zeros in a string.
    for peer, own in (("client", 1), ("server", 3)):
        zeros = LIMITS[f"max_{peer}_values"] - 2 - own
        most = b'{"a":[' + b"0," * (zeros - 1) + b"0],%s"
        assert breaches(says(peer, most)) == {}
        assert breaches(says(peer, most.replace(b"0,0", b'0,"0,0"', 1))) == {}
        assert breaches(says(peer, most.replace(b"0,0", b"0,{}", 1))) == {}
        assert breaches(says(peer, most.replace(b"0,0", b"0,[0]", 1))) == {(peer, "JSN-12"): 1}


def test_depth_64_is_allowed() -> None:
    assert breaches(says("client", b'{"a":' + b"[" * 63 + b"]" * 63 + b",%s")) == {}
