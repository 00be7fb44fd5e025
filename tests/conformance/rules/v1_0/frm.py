"""Packets, of both peers."""

from tests.conformance.rules.talk import (
    ASK_SIZE,
    CLIENT_ENDS,
    SERVER_ENDS,
    SIZE,
    client,
    msg,
    raw,
    server,
    text,
)

HALF = b"\x1c\x00\x00\x00{"
SERVED = (client(ASK_SIZE), server(SIZE))
ASKS, TELLS = (step.data or b"" for step in SERVED)
COUNTS = len(TELLS).to_bytes(4, "little") + TELLS[4:]

TALKS = {
    "half a packet of the client": (msg(*SERVED, raw("c2s", HALF), CLIENT_ENDS), "client:FRM-1"),
    "half a packet while the stream lasts": (msg(*SERVED, raw("c2s", HALF)), ""),
    "half a packet when the other side leaves": (
        msg(*SERVED, raw("c2s", HALF), SERVER_ENDS, CLIENT_ENDS),
        "",
    ),
    "the longest payload": (msg(client(text(ASK_SIZE).ljust(1 << 20))), ""),
    "no payload": (msg(*SERVED, raw("s2c", b"\0\0\0\0more"), SERVER_ENDS), "server:FRM-2"),
    "too long a payload": (
        msg(*SERVED, raw("c2s", b"\1\0\20\0more"), raw("c2s", b"and"), CLIENT_ENDS),
        "client:FRM-2",
    ),
    "a length that counts the header": (msg(client(ASK_SIZE), raw("s2c", COUNTS)), "server:FRM-1"),
    "a header by itself": (
        msg(raw("c2s", ASKS[:4]), raw("c2s", ASKS[4:]), server(SIZE)),
        "client:FRM-7",
    ),
    "a header with what comes before it": (
        msg(*SERVED[:1] * 2, raw("s2c", TELLS + TELLS[:4]), raw("s2c", TELLS[4:])),
        "server:FRM-7",
    ),
    "a packet in two": (
        msg(client(ASK_SIZE), raw("s2c", TELLS[:3]), raw("s2c", TELLS[3:])),
        "",
    ),
}
