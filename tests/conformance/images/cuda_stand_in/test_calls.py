"""What is told from calls: made-up ones, so that each rule is seen alone; mutants show the rest."""

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
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call, parse
from splatbus_conformance.images.memory.cuda_stand_in.usage import (
    closed_while_reading,
    held,
    opened_again,
    under_way,
    unwaited,
)
from splatbus_conformance.wire.messages import Json, init_packet_1_0, init_packet_1_1

TICKS = itertools.count()
STREAMS = [(3, 0), (4, 1), (5, 0)]
"""Of a process: their numbers and their flags."""


def call(name: str, *, code: int = 0, process: int = 7, **values: Any) -> Call:
    return Call(next(TICKS), process, f"cuda{name}", code, 0)._replace(**values)


CREATED = [call("StreamCreate", stream=number, flags=flags) for number, flags in STREAMS]


def test_a_line_becomes_a_call() -> None:
    line = b'{"t":1.5,"pid":9,"call":"cudaFree","code":1,"on":0,"memory":"ab","size":64,"opened":0}'
    assert parse(line) == Call(1.5, 9, "cudaFree", 1, 0, memory="ab", size=64)
    assert str(parse(line)) == "cudaFree(code 1, device 0, memory ab, size 64)"


# Of clients


def read(stream: int = 0, memory: str = "m", offset: int = 0, how: str = "Memcpy2DAsync") -> Call:
    place = {"memory": memory, "offset": offset, "pitch": 16, "width": 16, "height": 4}
    return call(how, stream=stream, **place)


def wait(stream: int = 0, event: str = "e", code: int = 0) -> Call:
    return call("StreamWaitEvent", stream=stream, event=event, code=code)


OPENED = [
    call("IpcOpenMemHandle", memory="m", opened=1),
    call("IpcOpenEventHandle", event="e"),
    *CREATED,
]
DEPTH = 64
SYNC = call("StreamSynchronize", stream=3)
SYNC_ALL = call("StreamSynchronize", stream=0)
DESTROYED = call("EventDestroy", event="e")
AGAIN = [
    call("IpcOpenMemHandle", memory="n", opened=1),
    call("IpcOpenEventHandle", event="f"),
]


@pytest.mark.parametrize(
    "calls",
    [
        [wait(), read()],
        [wait(), read(), read(offset=DEPTH)],
        [wait(), read(), wait(), read()],
        [wait(4), read(4)],
        [wait(3), read(0)],
        [wait(0), read(3)],
        [call("EventSynchronize", event="e"), read(4)],
        [call("EventQuery", event="e"), read(4)],
        [wait(4), call("StreamSynchronize", stream=4), read(0)],
        [wait(4), call("EventRecord", event="own", stream=4), wait(3, "own"), read(3)],
        [read(memory="its own")],
        [read()._replace(code=1)],
        [call("Memcpy", memory="m")],
        [wait(3), read(3), SYNC, wait(3), read(3), SYNC, read(4, offset=DEPTH)],
        [wait(3), SYNC, wait(3), read(4), read(3), SYNC],
    ],
)
def test_a_copy_after_a_wait_is_in_order(calls: list[Call]) -> None:
    assert not list(unwaited([*OPENED, *calls]))


@pytest.mark.parametrize(
    "calls",
    [
        [read()],
        [wait(), read(), read()],
        [wait(), read(), read(offset=DEPTH - 1)],
        [wait(4), read(0)],
        [wait(0), read(4)],
        [wait(3), read(5)],
        [wait(event="another"), read()],
        [wait(code=702), read()],
        [call("EventQuery", event="e", code=600), read()],
        [wait(3), call("EventRecord", event="own", stream=4), wait(4, "own"), read(4)],
        [wait(), call("StreamSynchronize", stream=3), read(4)],
        [call("StreamWaitEvent", event="e", process=8), read()],
        [wait(), wait(event="another"), read(), read()],
        [wait(3), SYNC, wait(3), read(4), SYNC, read(4)],
        [wait(), SYNC_ALL, DESTROYED, *AGAIN, read(4, "n")],
    ],
)
def test_a_copy_without_a_wait_is_found(calls: list[Call]) -> None:
    assert list(unwaited([*OPENED, *calls])) == calls[-1:]


def test_memory_that_was_opened_twice_is_found() -> None:
    again = call("IpcOpenMemHandle", memory="m", opened=2)
    assert list(opened_again([*OPENED, again])) == [again]


def test_what_is_held_is_what_was_not_given_back() -> None:
    close = call("IpcCloseMemHandle", memory="m", opened=0)
    destroy = call("EventDestroy", event="e")
    assert held(OPENED) == {(7, "m"), (7, "e")}
    assert held([*OPENED, close]) == {(7, "e")}
    assert held([*OPENED, close, destroy]) == set()
    assert held([*OPENED, close._replace(opened=1), destroy]) == {(7, "m")}
    assert held([*OPENED, close._replace(code=1), destroy._replace(process=8)]) == held(OPENED)
    assert held([*OPENED, call("Exit")]) == held([*OPENED, call("DeviceReset")]) == set()


def test_closing_before_the_copies_have_finished_is_found() -> None:
    close = call("IpcCloseMemHandle", memory="m", opened=0)
    assert list(closed_while_reading([*OPENED, read(), close])) == [close]
    for finishes in (
        call("StreamSynchronize"),
        call("DeviceSynchronize"),
        call("EventSynchronize", event="own"),
        call("EventQuery", event="own"),
        read(how="Memcpy2D"),
    ):
        assert not list(closed_while_reading([*OPENED, read(), finishes, close]))
    for does_not in (
        call("StreamQuery", code=600),
        call("EventSynchronize", event="e"),
        call("StreamSynchronize", process=8),
    ):
        assert list(closed_while_reading([*OPENED, read(), does_not, close])) == [close]


def test_copies_are_under_way_until_the_host_knows() -> None:
    first, second = read(), read(memory="other")
    assert under_way([*OPENED, first, second], "m") == [first]
    assert not under_way([*OPENED, first, second, call("StreamSynchronize")], "m")


# Of servers

PLANES = {"colour": PlaneSpan("m", 0, 160), "depth": PlaneSpan("m", 160, 200)}
NAME = "0123456789abcdef"
HANDLE = base64.b64encode(
    f"splatbus-stand-in memory 0000000007 {NAME}".encode().ljust(64, b"\0")
).decode()


def write(stream: int = 0, at: int = 0, size: int = 160, how: str = "MemcpyAsync") -> Call:
    return call(how, stream=stream, to="m", to_offset=at, width=size, height=1)


def image(stream: int = 0, how: str = "MemcpyAsync") -> list[Call]:
    return [write(stream, how=how), write(stream, 160, 40, how)]


def record(stream: int = 0, event: str = "e", code: int = 0) -> Call:
    return call("EventRecord", stream=stream, event=event, code=code)


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
    last = moments([*CREATED, *calls], "e", PLANES)[-1]
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
    assert moments([*CREATED, *calls], "e", PLANES)[-1].open == left


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
