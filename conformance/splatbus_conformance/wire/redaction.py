"""Leave tokens out of what is kept or shown of a session [NEG-2, NEG-21].

A token is replaced character by character, each by one of as many bytes. So every length and every
offset stays, pieces of a stream can be taken as they come, and a `hello` keeps its form.
"""

import json
from collections.abc import Iterable, Iterator
from itertools import cycle, islice

from splatbus_conformance.wire.conversation import Assembler
from splatbus_conformance.wire.packets import HEADER, is_length, packet
from splatbus_conformance.wire.recording import Channel, Direction, Entry

WORD = "redacted"
"""What stands in place of a token, as often as it takes."""
LEAST_ECHO, LEAST_PART = 8, 4
"""Bytes from which a token is looked for outside a `hello`, and a part of one at a piece's end:
shorter ones stand in innocent text by chance."""
MOST_NAME = 64
QUOTE, BACKSLASH = b'"\\'
NEXT, DIGIT = -1, 0
"""What follows in an escape: its letter, or the first of four digits."""


def redacted(entries: Iterable[Entry]) -> Iterator[Entry]:
    """The entries of a recording from its beginning, without the tokens in them."""
    redactor = Redactor()
    return map(redactor.redact, entries)


def stand_in(characters: int) -> str:
    """What stands in place of a token of so many characters."""
    return "".join(islice(cycle(WORD), characters))


def restored(entries: Iterable[Entry], token: str) -> tuple[list[Entry], int]:
    """A recording with this token where one was left out, and how many `hello` still lack theirs:
    all without a token to put there, and those that did not come in one piece.
    """
    assembler = Assembler()
    found, lacking = [], 0
    for entry in entries:
        data = entry.data or b""
        _, completed = assembler.feed(entry)
        for message in completed if entry.dir == "c2s" else ():
            told = (message.value or {}).get("token")
            if isinstance(told, str) and told == stand_in(len(told)):
                payload = message.packet.payload
                before, _, behind = payload.partition(b'"%s"' % told.encode())
                new = packet(before + json.dumps(token).encode() + behind)
                old = packet(payload)
                lacking += not token or old not in data
                data = data.replace(old, new, 1) if token else data
        found.append(entry._replace(data=data) if entry.data else entry)
    return found, lacking


class Redactor:
    """Takes a recording as it grows; what a `hello` has told is known from then on."""

    def __init__(self) -> None:
        self._hellos: dict[tuple[Channel, int], _Client] = {}
        self._echoes: dict[tuple[Channel, int, Direction], bytes] = {}
        self._secrets: set[bytes] = set()

    def redact(self, entry: Entry) -> Entry:
        """The entry without the tokens in it; its bytes are as many."""
        if entry.data is None or entry.dir is None:
            return entry
        data = entry.data
        if entry.dir == "c2s":
            client = self._hellos.setdefault((entry.channel, entry.conn), _Client())
            data = client.feed(data)
            while client.told:
                self._secrets |= _spellings(client.told.pop())
        if self._secrets:
            data = self._without_echoes((entry.channel, entry.conn, entry.dir), data)
        return entry._replace(data=data)

    def _without_echoes(self, stream: tuple[Channel, int, Direction], data: bytes) -> bytes:
        """Without secrets elsewhere, which may begin in the piece before, or go on in the next."""
        before = self._echoes.get(stream, b"")
        said = before + data
        shown = bytearray(said)
        for secret in self._secrets:
            mask = stand_in(len(secret)).encode()
            at = said.find(secret[:LEAST_PART])
            while at >= 0:
                part = said[at : at + len(secret)]
                if secret.startswith(part):  # whole, or to the end of the piece
                    shown[at : at + len(part)] = mask[: len(part)]
                at = said.find(secret[:LEAST_PART], at + 1)
        self._echoes[stream] = said[1 - max(map(len, self._secrets)) :]
        return bytes(shown[len(before) :])


def _spellings(content: bytes) -> set[bytes]:
    """How a token may stand elsewhere, by how it stood between its quotes."""
    found = {content}
    try:
        token = json.loads(b'"%s"' % content)
    except ValueError:
        pass
    else:
        texts = (token, *(json.dumps(token, ensure_ascii=it)[1:-1] for it in (False, True)))
        found |= {it.encode(errors="replace") for it in texts}
    return {it for it in found if len(it) >= LEAST_ECHO}


class _Client:
    """What one client sends, cut into packets."""

    def __init__(self) -> None:
        self.told: list[bytes] = []
        """Tokens that it has said, as they stood between their quotes."""
        self._header = b""
        self._left = 0
        self._lost = False
        self._text = _Text(self.told)

    def feed(self, data: bytes) -> bytes:
        shown, at = bytearray(), 0
        while at < len(data):
            if self._lost:
                return bytes(shown) + data[at:]
            if not self._left:
                part = data[at : at + HEADER - len(self._header)]
                self._header += part
                shown += part
                at += len(part)
                if len(self._header) == HEADER:
                    self._left = int.from_bytes(self._header, "little")
                    self._lost = not is_length(self._left)
                    self._header, self._text = b"", _Text(self.told)
                continue
            part = data[at : at + self._left]
            whole = len(part) == self._left and self._text.is_new
            # Most packets come whole, and few of them have anything like a token.
            plain = whole and b"oken" not in part and b"\\" not in part
            shown += part if plain else bytes(map(self._text.feed, part))
            at += len(part)
            self._left -= len(part)
        return bytes(shown)


class _Text:
    """A JSON text, read byte by byte, as far as it takes to see the member `token` in it."""

    def __init__(self, told: list[bytes]) -> None:
        self.is_new = True
        self._told = told
        self._depth = 0
        self._awaits_name = False
        self._name = b""
        """Of the member of the outermost object that is read."""
        self._string: bytearray | None = None
        """What it is in, so far; of what matters to nobody, nothing."""
        self._instead = bytearray()
        """What stands in its place, if it is a token."""
        self._kind = ""
        """`name`, `token`, or another string."""
        self._escape: int | None = None
        self._surrogate = False
        self._rest = b""
        """What stands in place of the next bytes of a character."""
        self._word = cycle(WORD.encode())

    def feed(self, byte: int) -> int:
        """The next byte; what stands in its place."""
        self.is_new = False
        if self._string is None:
            self._between(byte)
            return byte
        if byte == QUOTE and self._escape is None:
            if self._kind == "token" and self._instead != self._string:
                self._told.append(bytes(self._string))
            elif self._kind == "name":
                self._name = bytes(self._string)
            self._string = None
            return byte
        if self._kind == "token" or (self._kind == "name" and len(self._string) < MOST_NAME):
            self._string.append(byte)
        shown = self._character(byte)
        if self._kind != "token":
            return byte
        self._instead.append(shown)
        return shown

    def _between(self, byte: int) -> None:
        if byte == QUOTE:
            self._kind = "" if self._depth != 1 else "name" if self._awaits_name else "value"
            if self._kind == "value" and _is_token(self._name):
                self._kind = "token"
            self._string, self._instead = bytearray(), bytearray()
            self._escape, self._rest = None, b""
            self._word = cycle(WORD.encode())
        elif byte in b"{[":
            self._depth += 1
            self._awaits_name = self._depth == 1 and byte == ord("{")
        elif byte in b"}]":
            self._depth -= 1
        elif byte in b",:" and self._depth == 1:
            self._awaits_name = byte == ord(",")

    def _character(self, byte: int) -> int:
        """What stands in place of a byte of a token: of the same kind, so that its form stays."""
        if self._escape is not None:
            return self._escaped(byte)
        if byte == BACKSLASH:
            self._escape = NEXT
            return byte
        if self._rest and 0x80 <= byte < 0xC0:
            first, self._rest = self._rest[0], self._rest[1:]
            return first
        instead = next(self._word)
        for least, sign in ((0xF0, "😀"), (0xE0, "…"), (0xC2, "é")):
            if byte >= least:
                first, *rest = sign.encode()
                self._rest = bytes(rest)
                return first
        return byte if byte >= 0x80 else instead

    def _escaped(self, byte: int) -> int:
        assert self._escape is not None
        place, self._escape = self._escape, None
        if place == NEXT:
            if byte == ord("u"):
                self._escape = DIGIT
            return ord("/") if byte in b'"\\/bfnrt' else byte
        if byte not in b"0123456789abcdefABCDEF":
            return byte
        if place < 3:
            self._escape = place + 1
        if place == 0:
            self._surrogate = byte in b"dD"
        if place == 1 and self._surrogate:
            return b"08c"[(byte in b"89abAB") + 2 * (byte in b"cdefCDEF")]
        return (b"d000" if self._surrogate else b"0078")[place]


def _is_token(name: bytes) -> bool:
    try:
        return bool(json.loads(b'"%s"' % name) == "token")
    except ValueError:
        return False
