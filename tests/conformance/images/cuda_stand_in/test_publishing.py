"""What is told from a server's calls: made-up ones, so that each rule is seen alone."""

import base64
import itertools
from typing import Any

import pytest
from splatbus_conformance.images.memory.cuda_stand_in.publishing import (
    PlaneSpan,
    beside,
    freed,
    legacy_planes,
    moments,
    named,
    planes_of,
    share_left_open,
    slot_planes,
)
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call
from splatbus_conformance.wire.messages import Json, init_packet_1_0, init_packet_1_1

TICKS = itertools.count()
PLANES = {"colour": PlaneSpan("m", 0, 160), "depth": PlaneSpan("m", 160, 200)}
NAME = "0123456789abcdef"
HANDLE = base64.b64encode(
    f"splatbus-stand-in memory 0000000007 {NAME}".encode().ljust(64, b"\0")
).decode()


def call(name: str, *, code: int = 0, process: int = 7, **values: Any) -> Call:
    return Call(next(TICKS), process, f"cuda{name}", code, 0)._replace(**values)


def write(stream: int = 0, at: int = 0, size: int = 160, how: str = "MemcpyAsync") -> Call:
    return call(how, stream=stream, to="m", to_offset=at, width=size, height=1)


def image(stream: int = 0, how: str = "MemcpyAsync") -> list[Call]:
    return [write(stream, how=how), write(stream, 160, 40, how)]


def record(stream: int = 0, event: str = "e", code: int = 0) -> Call:
    return call("EventRecord", stream=stream, event=event, code=code)


STREAMS = [
    call("StreamCreate", stream=3, flags=0),
    call("StreamCreate", stream=4, flags=1),
    call("StreamCreate", stream=5, flags=0),
]


@pytest.mark.parametrize(
    "calls",
    [
        [*image(), record()],
        [*image(4), record(4)],
        [*image(3), record(0)],
        [*image(0), record(3)],
        [*image(4), call("StreamSynchronize", stream=4), record(0)],
        [*image(4), call("DeviceSynchronize"), record(3)],
        [*image(4, "Memcpy"), record(3)],
        [*image(4), record(4, "own"), call("StreamWaitEvent", stream=3, event="own"), record(3)],
        [*image(4), record(4, "own"), call("EventSynchronize", event="own"), record(5)],
        [record(4), *image(4), record(4)],
        [write(4, 0, 200), record(4)],
        [write(0, 0, 4096, "Memset"), *image(4), record(4)],
        [write(4), write(3, 160, 40), call("DeviceSynchronize"), record(5)],
    ],
)
def test_an_image_with_its_event_behind_it(calls: list[Call]) -> None:
    last = moments([*STREAMS, *calls], "e", PLANES)[-1]
    assert last.recorded
    assert last.written == PLANES.keys()
    assert not last.open


@pytest.mark.parametrize(
    ("calls", "left"),
    [
        (image(), {"colour", "depth"}),
        ([*image(), record(event="another")], {"colour", "depth"}),
        ([*image(), record(code=400)], {"colour", "depth"}),
        ([record(), *image()], {"colour", "depth"}),
        ([write(), record(), write(0, 160, 40)], {"depth"}),
        ([*image(), record(), write(0, 152, 8)], {"colour"}),
        ([*image(4), record(3)], {"colour", "depth"}),
        ([*image(3), record(5)], {"colour", "depth"}),
        ([*image(4), call("StreamSynchronize", stream=3), record(3)], {"colour", "depth"}),
        ([write(4), write(3, 160, 40), record(3)], {"colour"}),
        ([write(4), write(3, 1), write(3, 160, 40), record(3)], {"colour"}),
        ([*image(4), call("StreamWaitEvent", stream=3, event="own"), record(3)], set(PLANES)),
    ],
)
def test_an_image_without_its_event_behind_it(calls: list[Call], left: set[str]) -> None:
    assert moments([*STREAMS, *calls], "e", PLANES)[-1].open == left


def test_the_share_of_the_time_without_an_event() -> None:
    good = [*image(), record(), *image(), record()]
    good = [each._replace(time=t) for each, t in zip(good, (0, 1, 2, 30, 31, 32), strict=True)]
    assert share_left_open(moments(good, "e", PLANES), PLANES) == 2 / 32
    bad = [record(), *image(), record(), *image()]
    bad = [each._replace(time=t) for each, t in zip(bad, (0, 1, 2, 30, 31, 32), strict=True)]
    assert share_left_open(moments(bad, "e", PLANES), PLANES) == 28 / 32
    assert share_left_open([], PLANES) == 0.0


def test_what_lies_beside_images() -> None:
    out = call("MemcpyAsync", memory="m", offset=200, width=8, height=1)
    into, of_all = write(0, 200, 8), write(0, 0, 4096, "Memset")
    others = [write()._replace(to="another"), write(0, 200, 8)._replace(code=1), *image()]
    within = call("Memcpy2D", memory="m", offset=160, width=8, pitch=8, height=5)
    calls = [*others, of_all, within, into, out]
    assert list(beside(calls, PLANES.values())) == [into, out]


def test_what_is_freed() -> None:
    calls = [
        call("Free", memory="another"),
        call("Free", memory="m", code=1),
        call("DeviceReset", process=8),
        call("EventDestroy", event="e"),
    ]
    assert freed(calls, ["m"], 7) is None
    assert freed(calls, ["m", "e"], 7) == calls[3]
    assert freed(calls, ["m"], 8) == calls[2]


def test_planes_of_init_packets() -> None:
    handles = {"mem_color": HANDLE, "mem_depth": HANDLE}
    packet: Json = init_packet_1_0(4, 2) | handles
    legacy = {"colour": PlaneSpan(NAME, 0, 128), "depth": PlaneSpan(NAME, 128, 160)}
    assert legacy_planes(packet) == legacy
    del packet["meta"]["offsetColor"]
    assert legacy_planes(packet) == legacy
    ring = init_packet_1_1("", 1, 4, 2, 2) | {"memory": {"handle": HANDLE}}
    assert slot_planes(ring, 1) == {
        "colour": PlaneSpan(NAME, 128, 256),
        "depth": PlaneSpan(NAME, 288, 320),
    }
    assert len(planes_of(packet | {"ring": ring["ring"], "memory": ring["memory"]})) == 6


@pytest.mark.parametrize("broken", [{}, {"meta": 1}, {"meta": {"w": "4", "h": []}}, {"ring": []}])
def test_broken_init_packets_have_no_planes(broken: Json) -> None:
    assert planes_of({"mem_color": HANDLE, "memory": HANDLE, **broken}) == []


@pytest.mark.parametrize("handle", [None, 7, "", HANDLE[:-4], init_packet_1_0()["mem_color"]])
def test_what_is_no_handle_of_the_stand_in_names_nothing(handle: object) -> None:
    assert named(handle) is None
