"""What bytes are that are no packets: the usual mistakes of framing, told by the first bytes."""

from __future__ import annotations

import json
import re

from splatbus_schemas import FRAMING, LIMITS
from splatbus_schemas.visible import visible

HEADER: int = FRAMING["length"]["bytes"]
MOST: int = LIMITS["max_payload_bytes"]
_HTTP = re.compile(rb"(GET|HEAD|POST|PUT|DELETE|OPTIONS|CONNECT|PATCH|PRI) |HTTP|RTSP")
_ANSWER = re.compile(rb"HTTP/\d|RTSP/\d")
_SERVER = re.compile(rb"\nserver: *([ -~]{1,80})", re.IGNORECASE)
_TLS = re.compile(rb"\x16\x03[\x00-\x04]", re.DOTALL)
_NAMED_LENGTH = re.compile(rb"content-length:", re.IGNORECASE)
_SPELLED_LENGTH = re.compile(rb"\d{1,7}\s*[:,]?\s*\{")
_JSON = re.compile(rb"(\xef\xbb\xbf)?\s*[{\[]")
BEHIND = "{} stands behind the packet before: nothing stands between two packets"
BESIDE = (
    (b"\xef\xbb\xbf", "a byte-order mark stands before the header: nothing stands before that"),
    (b"\r\n", BEHIND.format("a line break")),
)
"""Bytes in front of a header, and what they are."""
FOREIGN = (
    (re.compile(rb"\s*<(!doctype|html)\b", re.IGNORECASE), "this is a page of a web server"),
    (re.compile(rb"SSH-\d"), "an SSH server answers here"),
    (
        _TLS,
        "this is the first message of TLS, and SplatBus goes over plain TCP: tunnel it (ssh -L)",
    ),
    (_NAMED_LENGTH, "this is a header of text; the length goes as four bytes before each message"),
    (_SPELLED_LENGTH, "the length is spelled in digits, where four bytes have to hold it"),
)


def recognised(data: bytes) -> str:
    """What a stream is whose first four bytes are no length (FRM-2), as the end of a sentence.

    Nothing if it is not known.

    Args:
        data: the stream from that header on, as far as it came.
    """
    if _ANSWER.match(data):
        named = _SERVER.search(data)
        name = f", {visible(named[1].decode())}" if named else ""
        return f"this is the answer of a web server{name}, and SplatBus goes over plain TCP"
    if _HTTP.match(data):
        if b"upgrade: websocket" in data.lower():
            return "this opens a WebSocket, and SplatBus goes over plain TCP"
        return "this is HTTP, and SplatBus goes over plain TCP: a browser or a web library came"
    for pattern, meaning in FOREIGN:
        if pattern.match(data):
            return meaning
    if _JSON.match(data):
        line = ", and no line break after it" if b"\n" in data else ""
        return f"this is JSON without a header: the length goes as four bytes before it{line}"
    if data[2:3] == b"{" and data[:2] != b"{}":
        return "a length of two bytes stands before the JSON: the header has four bytes"
    for extra, what in BESIDE:
        if data.startswith(extra) and _begins_packet(data[len(extra) :]):
            return what
    if 1 <= (length := int.from_bytes(data[:HEADER], "big")) <= MOST:
        return f"in the other byte order it is {length:,}: the length has to be little-endian"
    return ""


def _begins_packet(data: bytes) -> bool:
    length = int.from_bytes(data[:HEADER], "little")
    return 1 <= length <= MOST and data[HEADER : HEADER + 1] == b"{"


def astray(payload: bytes, rest: bytes) -> str:
    """What went wrong with a payload that is no JSON, behind which the stream goes on so; as above.

    Where a length is wrong, that is seen only in what follows.
    """
    whole = payload
    for byte in rest[: len(payload)]:
        whole += bytes([byte])
        if byte == ord("}") and _is_json(whole) and len(whole.decode()) == len(payload):
            return "the length counts characters, some of which are several bytes: it counts bytes"
    return misread(payload)


def misread(payload: bytes) -> str:
    """What a payload is that is no JSON because its header is of another kind, as above."""
    if payload[:HEADER] == bytes(HEADER) and payload[HEADER : HEADER + 1] == b"{":
        return "four bytes of 0 stand before the JSON: the header has four bytes, not eight"
    if payload[:1] == b"{" and not _is_json(payload):
        if _is_json(payload[:-HEADER]):
            return "four bytes stand behind the JSON: the length does not count the header"
        if payload.endswith(b"\0") and _is_json(payload.rstrip(b"\0")):
            return "a byte of 0 stands behind the JSON: the text has no terminator"
    if payload[:2] == b"\0{" and payload[2:3] != b"\0":
        return BEHIND.format("a byte, such as 0 or a line break,")
    if payload[:2] in (b"{\0", b"\xff\xfe", b"\0{", b"\xfe\xff"):
        return "the text is UTF-16, where UTF-8 is wanted"
    return ""


def cut_short(begun: bytes) -> str:
    """What a payload is whose end never came, as above."""
    if begun[:2] == b"\0{":
        return misread(begun)
    return "it is whole: the length does not count the header" if _is_json(begun) else ""


def _is_json(text: bytes) -> bool:
    try:
        return isinstance(json.loads(text), dict)
    except (ValueError, RecursionError):
        return False
