"""Init packets that break no rule, and yet are not what a server usually sends."""

import math
from typing import Any

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.init_packets import INFINITE_DEPTH, ROOM, changed
from splatbus_conformance.cases.rings import GAP, MOST_GAPS, ORDERS, Arrangement, arranged
from splatbus_conformance.wire.messages import EXAMPLE_HANDLE, Json, init_packet_1_1

MOST_DEPTH = math.nextafter(INFINITE_DEPTH, 0.0)


@st.composite
def layouts(draw: st.DrawFn) -> Json:
    """Rings of any size, order and spacing that fit into `ROOM` bytes; name and generation open."""
    width, height, slots = (
        draw(st.integers(1, 48)),
        draw(st.integers(1, 48)),
        draw(st.integers(1, 6)),
    )
    packet = init_packet_1_1("", 0, width, height, slots)
    gaps = st.integers(0, MOST_GAPS).map(lambda n: GAP * n)
    order = draw(st.sampled_from(ORDERS))
    packet = arranged(packet, Arrangement(order, draw(gaps), draw(gaps), draw(gaps)))
    end = packet["memory"]["bytes"]
    packet["memory"]["bytes"] = draw(st.sampled_from((end, end + 1, ROOM)))
    return packet


def unusual_packets() -> list[tuple[str, Json]]:
    """Good init packets at the edges of the rules, with a word on each; name, generation open."""
    ordinary = init_packet_1_1("", 0)
    return [
        ("one pixel in one slot", init_packet_1_1("", 0, 1, 1, 1)),
        ("the widest image", init_packet_1_1("", 0, 32768, 1, 1)),
        ("the highest image", init_packet_1_1("", 0, 1, 32768, 1)),
        ("an odd size", init_packet_1_1("", 0, 3, 5)),
        ("the most slots", init_packet_1_1("", 0, 1, 1, 1024)),
        ("memory larger than its ring", changed(ordinary, {"memory/bytes": ROOM})),
        ("offsets", changed(ordinary, {"meta/offsetColor": 1 << 40, "meta/offsetDepth": 4})),
        ("a device", changed(ordinary, {"meta/device": 2**53 - 1})),
        ("members of CUDA memory", changed(ordinary, CUDA_MEMBERS)),
        ("the greatest empty depth", changed(ordinary, {"semantics/depth/empty": MOST_DEPTH})),
    ]


CUDA_MEMBERS: dict[str, Any] = {
    "memory/deviceUuid": "GPU-00000000-0000-4000-8000-000000000000",
    "memory/handle": EXAMPLE_HANDLE.decode(),
    "ring/events": [EXAMPLE_HANDLE.decode()],
}
"""Members that have no meaning in memory of the host, and are ignored there."""
SEMANTICS: tuple[dict[str, Any], ...] = (
    {"semantics/alpha": "premultiplied"},
    {"semantics/colorSpace": "linear"},
    {"semantics/depth/kind": "ray_distance"},
    {"semantics/depth/estimator": "harmonic", "semantics/depth/empty": 0.1},
    {"semantics/depth/estimator": "median", "semantics/depth/empty": 0},
    {"semantics/unitMetres": 0.01, "semantics/origin": [1e6, -2.5, 3]},
)
"""Meanings of pixels that a client may show or decline (MEM-13)."""
