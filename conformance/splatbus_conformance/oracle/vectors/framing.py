"""`framing.json`: byte streams, and the packets that they hold."""

from collections.abc import Sequence

from splatbus_schemas import LIMITS

from splatbus_conformance.oracle.vectors.layout import Json

MAX = LIMITS["max_payload_bytes"]
SIZE = b'{"type":"get_viewport_size"}'
ASK = b'{"type":"get_camera_pose","cam_idx":0}'
EVERY_BYTE = "every byte"

Pieces = list[Json]


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "framing",
        "version": "1.0",
        "description": "Byte streams of one direction of one connection. `stream` is a list of"
        " pieces, each `hex` repeated `times` times; a receiver gets it divided at the offsets"
        " `cuts`, and must find the same for every other division. `packets` are the payloads, in"
        " order, that it hands out. `outcome` tells what is left: `whole`, nothing; `incomplete`,"
        " the beginning of a packet that starts at byte `offset`, which is discarded when the"
        " connection ends; `refused`, a header at byte `offset` for which the receiver closes.",
        "requirements": ["FRM-1", "FRM-2", "FRM-3", "FRM-4", "FRM-6"],
        "cases": [*_whole(), *_divided(), *_incomplete(), *_refused()],
    }


def _whole() -> list[Json]:
    largest = [_piece(b"{"), _piece(b" ", MAX - 2), _piece(b"}")]
    header_within = b'{"a":"' + bytes([2, 0, 0, 0]).hex().encode() + b'"}'
    return [
        _case("one packet", "FRM-1", _packet(SIZE), [SIZE]),
        _case("no byte at all", "FRM-1", [], []),
        _case("the shortest payload", "FRM-2", _packet(b"0"), [b"0"]),
        _case("an empty object", "FRM-1", _packet(b"{}"), [b"{}"]),
        _case("a payload of 255 bytes", "FRM-1", *_long(255)),
        _case("a payload of 256 bytes", "FRM-1", *_long(256)),
        _case("a payload of 65,536 bytes", "FRM-1", *_long(65_536)),
        _case("the longest payload", "FRM-2", [_header(MAX), *largest], [largest]),
        _case("the longest payload, and one more", "FRM-2",
              [_header(MAX), *largest, *_packet(SIZE)], [largest, SIZE]),
        _case("a payload that is no JSON is a packet all the same", "FRM-1",
              _packet(bytes([0, 255, 10])), [bytes([0, 255, 10])]),
        _case("a payload that holds what looks like a header", "FRM-1",
              _packet(header_within), [header_within]),
        _case("a payload that ends in a line feed", "FRM-1", _packet(b"{}\n"), [b"{}\n"]),
        _case("characters beyond ASCII count as their bytes", "FRM-1",
              _packet('{"n":"é€😀"}'.encode()), ['{"n":"é€😀"}'.encode()]),
    ]  # fmt: skip


def _divided() -> list[Json]:
    two = [*_packet(SIZE), *_packet(ASK)]
    first = 4 + len(SIZE)
    return [
        _case("two packets at once", "FRM-4", two, [SIZE, ASK]),
        _case("byte by byte", "FRM-4", two, [SIZE, ASK], cuts=EVERY_BYTE),
        _case("header and payload apart", "FRM-4", _packet(SIZE), [SIZE], cuts=[4]),
        _case("a header in two", "FRM-4", _packet(SIZE), [SIZE], cuts=[2]),
        _case("a header byte by byte", "FRM-4", _packet(SIZE), [SIZE], cuts=[1, 2, 3, 4]),
        _case("a payload in two", "FRM-4", _packet(SIZE), [SIZE], cuts=[17]),
        _case("the end of one packet with the beginning of the next", "FRM-4", two, [SIZE, ASK],
              cuts=[first - 3, first + 2]),
        _case("the second header in two", "FRM-4", two, [SIZE, ASK], cuts=[first + 3]),
        _case("a character in two", "FRM-4", _packet('{"n":"€"}'.encode()),
              ['{"n":"€"}'.encode()], cuts=[11]),
        _case("twenty packets at once", "FRM-4", [_piece(b"\2\0\0\0{}", 20)], [b"{}"] * 20),
    ]  # fmt: skip


def _incomplete() -> list[Json]:
    return [
        _case("one byte of a header", "FRM-6", [_piece(b"\x1c")], [], incomplete=0),
        _case("three bytes of a header", "FRM-6", [_piece(b"\x1c\0\0")], [], incomplete=0),
        _case("a header and nothing else", "FRM-6", [_header(28)], [], incomplete=0),
        _case("all but the last byte", "FRM-6", [_header(28), _piece(SIZE[:-1])], [],
              incomplete=0),
        _case("a packet, then half a packet", "FRM-6",
              [*_packet(SIZE), _header(len(ASK)), _piece(ASK[:10])], [SIZE],
              incomplete=4 + len(SIZE)),
        _case("a line feed after a packet begins the next header", "FRM-1",
              [*_packet(b"{}"), _piece(b"\n")], [b"{}"], incomplete=6),
        _case("the longest payload but for one byte", "FRM-6",
              [_header(MAX), _piece(b" ", MAX - 1)], [], incomplete=0),
    ]  # fmt: skip


def _refused() -> list[Json]:
    http = b"GET / HTTP/1.1\r\nHost: 127.0.0.1:6000\r\n\r\n"
    return [
        _case("length 0", "FRM-3", [_header(0)], [], refused=0),
        _case("length 0 after a packet", "FRM-3", [*_packet(SIZE), _header(0)], [SIZE],
              refused=4 + len(SIZE)),
        _case("nothing after a refused header counts", "FRM-3", [_header(0), *_packet(SIZE)], [],
              refused=0),
        _case("length 1,048,577", "FRM-3", [_header(MAX + 1)], [], refused=0),
        _case("length 1,048,577 after a packet, byte by byte", "FRM-3",
              [*_packet(SIZE), _header(MAX + 1)], [SIZE], cuts=EVERY_BYTE,
              refused=4 + len(SIZE)),
        _case("length 1,048,577 and its payload", "FRM-3",
              [_header(MAX + 1), _piece(b" ", MAX + 1)], [], refused=0),
        _case("length 0x7FFFFFFF, the largest signed", "FRM-3", [_header(0x7FFFFFFF)], [],
              refused=0),
        _case("length 0x80000000, negative if read as signed", "FRM-3", [_header(0x80000000)], [],
              refused=0),
        _case("length 0xFFFFFFFF", "FRM-3", [_header(0xFFFFFFFF)], [], refused=0),
        _case("a big-endian length", "FRM-3",
              [_piece(len(SIZE).to_bytes(4, "big")), _piece(SIZE)], [], refused=0),
        _case("an HTTP request", "FRM-3", [_piece(http)], [], refused=0),
        _case("a payload without a header", "FRM-3", [_piece(SIZE)], [], refused=0),
    ]  # fmt: skip


def _piece(content: bytes, times: int = 1) -> Json:
    return {"hex": content.hex()} if times == 1 else {"hex": content.hex(), "times": times}


def _header(length: int) -> Json:
    return _piece(length.to_bytes(4, "little"))


def _packet(payload: bytes) -> Pieces:
    return [_header(len(payload)), _piece(payload)]


def _long(length: int) -> tuple[Pieces, list[Pieces]]:
    payload = [_piece(b"{"), _piece(b" ", length - 2), _piece(b"}")]
    return [_header(length), *payload], [payload]


def _case(
    name: str,
    requirement: str,
    stream: Pieces,
    packets: Sequence[bytes | Pieces],
    *,
    cuts: Sequence[int] | str = (),
    incomplete: int | None = None,
    refused: int | None = None,
) -> Json:
    case: dict[str, Json] = {
        "name": name,
        "requirement": requirement,
        "stream": stream,
        "cuts": cuts if cuts == EVERY_BYTE else list(cuts),
        "packets": [[_piece(p)] if isinstance(p, bytes) else p for p in packets],
    }
    if refused is not None:
        return {**case, "outcome": "refused", "offset": refused}
    if incomplete is not None:
        return {**case, "outcome": "incomplete", "offset": incomplete}
    return {**case, "outcome": "whole"}
