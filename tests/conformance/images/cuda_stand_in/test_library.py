"""The stand-in's libraries: what they refuse, what passes between processes, and the trace."""

import json
import os
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from splatbus_conformance.images.memory.cuda_stand_in.building import DRIVER
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn

from tests.conformance.images.cuda_stand_in.library import library, stand_in

SCRIPT = Path(__file__).with_name("cuda.py")
REFUSED = {
    "cuda.Free(own + 16)": 1,
    "cuda.Free(host)": 1,
    "cuda.Memcpy(host, own - 8, 8, D2H)": 1,
    "cuda.Memcpy(host, own, 4097, D2H)": 1,
    "cuda.Memcpy(host, host, 8, D2H)": 1,
    "cuda.Memset(host, 7, 8)": 1,
    "cuda.Memcpy2D(host, 8, own, 16, 9, 2, D2H)": 12,
    "cuda.Memcpy2D(host, 8, own + 57, 64, 8, 64, D2H)": 1,
    "cuda.Memcpy2D(host, 1 << 63, own, 1 << 63, 8, 3, D2H)": 1,
    "cuda.EventCreateWithFlags(host, INTERPROCESS)": 1,
    "cuda.EventRecord(None, None)": 400,
    "cuda.StreamWaitEvent(None, None, 0)": 400,
    "cuda.IpcGetEventHandle(host, cuda.made('EventCreateWithFlags', UNTIMED))": 400,
    "cuda.IpcGetMemHandle(host, cuda.made('MallocHost', 8))": 1,
    "cuda.opened('Mem', cuda.handle('Mem', own), 1)": -201,
    "cuda.opened('Mem', theirs, 0)": -1,
    "cuda.opened('Mem', their_event, 1)": -1,
    "cuda.opened('Mem', '55' * 64, 1)": -1,
    "cuda.opened('Event', '55' * 64)": -205,
    "cuda.IpcCloseMemHandle(own)": 1,
    "cuda.Free(cuda.opened('Mem', theirs, 1))": 1,
    "[cuda.Free(own), cuda.Free(own), cuda.Memcpy(host, own, 8, D2H)]": [0, 1, 1],
}
"""As by runtime 13.0 on an H200."""
WITHOUT_A_CONTEXT = {
    "cuda.DeviceGetCount(host)": 3,
    "[cuda.Init(0), cuda.DeviceGetCount(host)]": [0, 0],
    "cuda.MemAlloc(host, 8)": 201,
    "cuda.opened('Mem', theirs, 1)": -201,
    "cuda.StreamSynchronize(None)": 201,
    "cuda.CtxPushCurrent(cuda.made('DevicePrimaryCtxRetain', 0))": 0,
    "cuda.MemGetAddressRange(host, None, cuda.made('MemAlloc', 8) + 7)": 0,
    "cuda.MemGetAddressRange(host, None, 8)": 500,
}
"""As by driver 580 on an H100."""


class Program:
    """A process with the library: `program("expression")` evaluates it there, as cuda.py says."""

    def __init__(self, stand_in: StandIn, path: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(SCRIPT), path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **stand_in.environment()},
        )

    def send(self, line: str) -> None:
        assert self.process.stdin is not None
        print(line, file=self.process.stdin, flush=True)

    def answer(self) -> Any:
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def __call__(self, line: str) -> Any:
        self.send(line)
        return self.answer()

    def copied(self, pointer: int, size: int) -> bytes:
        """Bytes that it copies out of device memory."""
        copy = f"cuda.Memcpy(host, {pointer}, {size}, D2H)"
        code, text = self(f"[{copy}, bytes(host[:{size}]).hex()]")
        assert code == 0
        return bytes.fromhex(text)

    def leave(self) -> int:
        with self.process:
            assert self.process.stdin is not None
            self.process.stdin.close()
            return self.process.wait(30)


@contextmanager
def program(stand_in: StandIn, path: str = "") -> Iterator[Program]:
    found = Program(stand_in, path or library())
    try:
        yield found
    finally:
        found.leave()


def driver() -> str:
    return str(Path(library()).with_name(DRIVER))


@pytest.mark.parametrize("path", [library, driver])
def test_what_a_real_device_refuses_is_refused(path: Any) -> None:
    with stand_in() as it, program(it, path()) as client:
        theirs = it.device.allocate(8).handle.hex(), it.device.event().handle.hex()
        client(f"globals().update(theirs='{theirs[0]}', their_event='{theirs[1]}')")
        if path is library:
            client("globals().update(own=cuda.made('Malloc', 4096))")
        answers = REFUSED if path is library else WITHOUT_A_CONTEXT
        assert {line: client(line) for line in answers} == answers


def test_shows_memory_that_the_harness_wrote() -> None:
    with stand_in() as it, program(it) as client:
        memory = it.device.allocate(5000)
        memory.write(100, b"from the harness")
        opens = f"cuda.opened('Mem', '{memory.handle.hex()}', 1)"
        pointer = client(opens)
        assert client(opens) == pointer
        assert client.copied(pointer + 100, 16) == b"from the harness"
        assert client.copied(pointer, 4) == b"\xff" * 4, "what nobody wrote is poison"
        memory.free()
        assert client.copied(pointer + 100, 4) == b"\xff" * 4, "freed memory is poison"
        assert [client(f"cuda.IpcCloseMemHandle({pointer})") for _ in range(3)] == [0, 0, 1]
        assert client(opens) == -1


def test_the_harness_reads_what_a_server_exports_until_that_ends() -> None:
    with stand_in() as it, program(it) as server, program(it) as client:
        text = server("cuda.handle('Mem', cuda.made('Malloc', 64))")
        handle = bytes.fromhex(text)
        assert it.device.read(handle, 0, 64) == b"\xff" * 64
        with pytest.raises(ValueError, match="ends before"):
            it.device.read(handle, 60, 8)
        for other in (handle[:-1] + b"x", it.device.event().handle):
            with pytest.raises(ValueError, match="no handle of memory"):
                it.device.read(other, 0, 1)
        server.leave()
        with pytest.raises(ValueError, match="was freed"):
            it.device.read(handle, 0, 64)
        assert client(f"cuda.opened('Mem', '{text}', 1)") == -400
        assert it.calls()[-1].function == "cudaIpcOpenMemHandle"
        assert [each.name[:5] for each in it.device.folder.iterdir()] == ["event"]


def test_the_harness_writes_within_its_memory() -> None:
    with stand_in() as it:
        memory = it.device.allocate(10)
        for offset in (-1, 8):
            with pytest.raises(ValueError, match=r"3 bytes at .* of 10"):
                memory.write(offset, b"abc")


def test_a_copy_of_rows_is_traced() -> None:
    image = bytes(range(240))
    rows = [image[24 * row :][:8] for row in range(10)]
    with stand_in() as it, program(it) as client:
        memory = it.device.allocate(512)
        memory.write(16, image)
        pointer = client(f"cuda.opened('Mem', '{memory.handle.hex()}', 1)")
        copy = f"cuda.Memcpy2D(host, 10, {pointer + 16}, 24, 8, 10, D2H)"
        assert client(copy) == 0
        copied = bytes.fromhex(client("bytes(host[:100]).hex()"))
        (call,) = (call for call in it.calls() if call.function == "cudaMemcpy2D")
    assert [copied[10 * row :][:8] for row in range(10)] == rows
    assert (call.memory, call.offset, call.pitch) == (memory.name, 16, 24)
    assert (call.width, call.height, call.to) == (8, 10, "")
    assert call.digest == zlib.adler32(b"".join(rows))


def test_the_host_cannot_touch_device_memory() -> None:
    with stand_in() as it, program(it) as client:
        client.send("ctypes.string_at(cuda.made('Malloc', 64), 1)")
        assert client.leave() == -11, "as with a real device: SIGSEGV"


@pytest.mark.parametrize("wait", ["EventSynchronize({event})", "StreamWaitEvent(None, {event}, 0)"])
def test_who_waits_for_a_pending_event_reads_after_it(wait: str) -> None:
    with stand_in() as it, program(it) as client:
        memory, event = it.device.allocate(4), it.device.event()
        pointer = client(f"cuda.opened('Mem', '{memory.handle.hex()}', 1)")
        opened = client(f"cuda.opened('Event', '{event.handle.hex()}')")
        assert client(f"cuda.EventQuery({opened})") == 0, "never recorded"
        event.begin()
        assert client(f"[cuda.EventQuery({opened}), cuda.PeekAtLastError()]") == [600, 0]
        copy = f"cuda.Memcpy(host, {pointer}, 4, D2H)"
        client.send(f"[cuda.{wait.format(event=opened)}, {copy}, bytes(host[:4]).hex()]")
        time.sleep(0.1)
        assert not [call for call in it.calls() if call.function == "cudaMemcpy"], "it waits"
        memory.write(0, b"done")
        event.complete()
        assert client.answer() == [0, 0, b"done".hex()]


def test_an_event_of_another_process_is_done_when_recorded() -> None:
    with stand_in() as it, program(it) as server, program(it) as client:
        event = server("cuda.made('EventCreateWithFlags', INTERPROCESS | UNTIMED)")
        text = server(f"cuda.handle('Event', {event})")
        opened = client(f"cuda.opened('Event', '{text}')")
        assert server(f"cuda.EventRecord({event}, None)") == 0
        assert client(f"[cuda.EventQuery({opened}), cuda.EventSynchronize({opened})]") == [0, 0]


def test_a_call_of_the_driver_leaves_the_line_of_the_runtimes_on_its_device() -> None:
    with stand_in() as it, program(it, driver()) as client:
        client("cuda.Init(0)")
        assert not it.calls(), "who looks for a driver only, and has a runtime of its own"
        client("cuda.CtxPushCurrent(cuda.made('DevicePrimaryCtxRetain', 1))")
        memory = it.device.allocate(64)
        memory.write(16, b"from the harness")
        pointer = client(f"cuda.opened('Mem', '{memory.handle.hex()}', 1)")
        host = client("ctypes.addressof(host)")
        source, target = (0, 0, 2, 0, pointer + 16, 0, 4), (0, 0, 1, host, 0, 0, 4)
        end = "2Qi4x4Q"
        rows = struct.pack(f"{end}{end}2Q", *source, *target, 4, 4)
        assert client(f"cuda.Memcpy2DAsync({rows}, None)") == 0
        assert client("bytes(host[:16]).decode()") == "from the harness"
        calls = [call for call in it.calls() if call.memory == memory.name]
    assert [call.function for call in calls] == ["cudaIpcOpenMemHandle", "cudaMemcpy2DAsync"]
    assert (calls[1].offset, calls[1].width, calls[1].height, calls[1].device) == (16, 4, 4, 1)


def test_devices_have_the_uuids_that_the_harness_announces() -> None:
    tell = "[cuda.Init(0), cuda.DeviceGetUuid(host, {}), bytes(host[:16]).hex()][2]"
    with stand_in() as it, program(it, driver()) as client:
        told = [client(tell.format(which)) for which in (0, 1)]
        assert told[0] == it.device.uuid.removeprefix("GPU-").replace("-", "")
    assert told[1] != told[0]
