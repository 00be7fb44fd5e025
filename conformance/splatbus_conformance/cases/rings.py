"""How the slots of a ring lie in its memory (spec 1.1 section 3.3)."""

from random import Random
from typing import NamedTuple

from splatbus_conformance.wire.messages import Json

GAP = 16
MOST_GAPS = 8
ORDERS = ("color first", "depth first", "interleaved")


class Arrangement(NamedTuple):
    """Which channel comes first, and how many bytes are left out, multiples of 16."""

    order: str = ORDERS[0]
    first: int = 0
    between: int = 0
    after: int = 0


TIGHT = Arrangement()


def drawn(seed: int) -> Arrangement:
    """An arrangement that no client guesses."""
    random = Random(f"ring {seed}")
    gaps = (GAP * random.randint(1, MOST_GAPS) for _ in range(3))
    return Arrangement(random.choice(ORDERS), *gaps)


def arranged(packet: Json, arrangement: Arrangement) -> Json:
    """An init packet whose ring is arranged so, and whose memory is as large as it has to be."""
    ring, (order, first, between, after) = packet["ring"], arrangement
    color, depth, slots = ring["colorStride"], ring["depthStride"], ring["slots"]
    if order == "interleaved":
        stride = color + between + depth + after
        begins = first, first + color + between
        strides = stride, stride
        end = first + slots * stride
    else:
        strides = color + between, depth + after
        if order == "color first":
            begins = first, first + slots * strides[0]
            end = begins[1] + slots * strides[1]
        else:
            begins = first + slots * strides[1], first
            end = begins[0] + slots * strides[0]
    names = ("colorOffset", "depthOffset", "colorStride", "depthStride")
    places = dict(zip(names, (*begins, *strides), strict=True))
    return packet | {"ring": ring | places, "memory": packet["memory"] | {"bytes": end}}
