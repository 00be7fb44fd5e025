"""What is told from calls: made-up ones, so that each rule is seen alone."""

import itertools

import pytest
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call, parse
from splatbus_conformance.images.memory.cuda_stand_in.usage import (
    closed_while_reading,
    held,
    opened_again,
    reads,
    under_way,
    unwaited,
)

TICKS = itertools.count()


def call(name: str, *, code: int = 0, process: int = 7, **values: object) -> Call:
    return Call(next(TICKS), process, f"cuda{name}", code, 0)._replace(**values)


def read(stream: int = 0, memory: str = "m", offset: int = 0, how: str = "Memcpy2DAsync") -> Call:
    place = {"memory": memory, "offset": offset, "pitch": 16, "width": 16, "height": 4}
    return call(how, stream=stream, **place)


def wait(stream: int = 0, event: str = "e", code: int = 0) -> Call:
    return call("StreamWaitEvent", stream=stream, event=event, code=code)


OPENED = [
    call("IpcOpenMemHandle", memory="m", opened=1),
    call("IpcOpenEventHandle", event="e"),
    call("StreamCreate", stream=3, flags=0),
    call("StreamCreate", stream=4, flags=1),
    call("StreamCreate", stream=5, flags=0),
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
    closed = call("IpcCloseMemHandle", memory="m", opened=0)
    assert not list(opened_again([*OPENED, closed, OPENED[0]]))


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
    assert under_way([*OPENED, first, call("StreamSynchronize", process=8)], "m") == [first]


def test_reads_are_those_of_one_memory() -> None:
    calls = [read(), read(memory="other"), read()._replace(code=1), call("Memset", to="m")]
    assert reads(calls, "m") == calls[:1]


def test_a_line_becomes_a_call() -> None:
    line = b'{"t":1.5,"pid":9,"call":"cudaFree","code":1,"on":0,"memory":"ab","size":64,"opened":0}'
    assert parse(line) == Call(1.5, 9, "cudaFree", 1, 0, memory="ab", size=64)
    assert str(parse(line)) == "cudaFree(code 1, device 0, memory ab, size 64)"
