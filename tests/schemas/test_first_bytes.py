"""Streams that are no packets are told by their first bytes, and packets are not mistaken."""

import json

import pytest
from splatbus_conformance.wire.packets import Splitter, packet
from splatbus_schemas.first_bytes import astray, recognised

TEXT = json.dumps({"type": "get_viewport_size"}).encode()
HEADERS = b"\r\nHost: localhost\r\n"
HELLO_OF_TLS = bytes.fromhex("16 03 01 02 00 01 00 01 fc 03 03")


def refused(stream: bytes) -> bytes:
    """What the splitter keeps of a stream from the header on that is none."""
    splitter = Splitter()
    assert splitter.feed(stream, 0.0) == []
    assert splitter.refused == 0, "the test is of streams that FRM-2 condemns"
    return splitter.rest


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        (len(TEXT).to_bytes(4, "big") + TEXT, "the length has to be little-endian"),
        (len(TEXT).to_bytes(4, "big"), "in the other byte order it is 29"),
        (TEXT, "JSON without a header"),
        (TEXT + b"\n" + TEXT + b"\n", "and no line break after it"),
        (b"\xef\xbb\xbf" + TEXT, "JSON without a header"),
        (b"29\n" + TEXT, "the length is spelled in digits"),
        (len(TEXT).to_bytes(2, "little") + TEXT, "a length of two bytes"),
        (b"\xef\xbb\xbf" + packet(TEXT), "a byte-order mark stands before the header"),
        (b"\r\n" + packet(TEXT), "a line break stands behind the packet before"),
        (b"Content-Length: 29\r\n\r\n" + TEXT, "a header of text"),
        (b"GET / HTTP/1.1" + HEADERS, "this is HTTP"),
        (b"GET / HTTP/1.1" + HEADERS + b"Upgrade: websocket\r\n\r\n", "opens a WebSocket"),
        (b"HTTP/1.1 400 Bad Request\r\nServer: nginx/1.2\r\n", "a web server, nginx/1.2"),
        (b"RTSP/1.0 400 Bad Request\r\n", "the answer of a web server, and"),
        (b"<!DOCTYPE html>\n<html>", "a page of a web server"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "an SSH server"),
        (HELLO_OF_TLS, "first message of TLS"),
        (b"\xff\xff\xff\xff", ""),
    ],
)
def test_a_stream_is_known_by_its_first_bytes(stream: bytes, words: str) -> None:
    said = recognised(refused(stream))
    assert words in said if words else not said


NAMED = json.dumps({"type": "hello", "name": "Zoë Žižek"}, ensure_ascii=False)
COUNTED = len(NAMED).to_bytes(4, "little") + NAMED.encode()


@pytest.mark.parametrize(
    ("one", "words"),
    [
        (COUNTED, "the length counts characters"),
        (len(TEXT).to_bytes(8, "little") + TEXT, "four bytes, not eight"),
        ((len(TEXT) + 4).to_bytes(4, "little") + TEXT, "the length does not count the header"),
        (packet(TEXT + b"\0"), "no terminator"),
        (packet(b"\0" + TEXT), "nothing stands between two packets"),
        (packet(TEXT.decode().encode("utf-16-le")), "UTF-16"),
        (packet(TEXT), ""),
        (packet(b"{broken"), ""),
    ],
)
def test_a_wrong_header_is_told_where_it_stands_and_not_where_reading_fails(
    one: bytes, words: str
) -> None:
    splitter = Splitter()
    told = astray(splitter.feed(one * 3, 0.0)[0].payload, splitter.rest)
    assert words in told if words else not told
