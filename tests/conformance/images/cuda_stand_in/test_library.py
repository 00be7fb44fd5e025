"""The stand-in's library beside a real runtime, and between two processes."""

import json
import time
import zlib
from pathlib import Path

import pytest

from tests.conformance.images.cuda_stand_in.cuda_runtime import GROUPS, answers
from tests.conformance.images.cuda_stand_in.library import library, program, stand_in

REAL = json.loads(
    Path(__file__).parents[3].joinpath("data", "cuda_runtime_answers.json").read_text("utf-8")
)["answers"]
BUSY = "pending"
"""A group that keeps a real device busy; below there is a test of its own for the stand-in."""
OTHERWISE = {
    # CUDA calls the use of a destroyed event undefined; the stand-in finds it.
    ("others_handles", "open it then"): 205,
    ("others_handles", "event of a process that has ended"): 205,
    # Texts of errors that the stand-in never gives.
    **{("texts", code): ["unrecognized error code"] * 2 for code in ("3", "17", "100", "801")},
}


@pytest.mark.parametrize("group", [g.__name__ for g in GROUPS if g.__name__ != BUSY])
def test_answers_as_a_real_runtime(group: str) -> None:
    with stand_in() as it:
        found = answers(library(), group, **it.environment())
    expected = {name: OTHERWISE.get((group, name), answer) for name, answer in REAL[group].items()}
    assert found == expected
    assert list(found) == list(expected)


def test_shows_memory_that_the_harness_wrote() -> None:
    with stand_in() as it, program(it) as client:
        memory = it.device.allocate(5000)
        memory.write(100, b"from the harness")
        pointer = client.opened(memory.handle)
        assert client.copied(pointer + 100, 16) == b"from the harness"
        assert client.copied(pointer, 4) == b"\xff" * 4, "what nobody wrote is poison"
        memory.write(100, b"and once more")
        assert client.copied(pointer + 100, 13) == b"and once more"
        memory.free()
        assert client.copied(pointer + 100, 4) == b"\xff" * 4, "freed memory is poison"
        assert client(f"cuda.IpcCloseMemHandle({pointer})") == 0
        assert (
            client(
                f"cuda.IpcOpenMemHandle(ctypes.byref(out), as_handle('{memory.handle.hex()}'), 1)"
            )
            == 1
        )


def test_the_harness_reads_what_a_server_exports() -> None:
    with stand_in() as it, program(it) as server:
        text = server("as_text(cuda.handle('IpcGetMemHandle', cuda.made('Malloc', 64)))")
        handle = bytes.fromhex(text)
        assert it.device.read(handle, 0, 64) == b"\xff" * 64
        with pytest.raises(ValueError, match="ends before"):
            it.device.read(handle, 60, 8)
        with pytest.raises(ValueError, match="no handle"):
            it.device.read(handle[:-1] + b"x", 0, 1)
        server.leave()
        with pytest.raises(ValueError, match="was freed"):
            it.device.read(handle, 0, 64)


def test_copies_rows_out_of_a_pitch() -> None:
    image = bytes(range(240))
    with stand_in() as it, program(it) as client:
        memory = it.device.allocate(512)
        memory.write(16, image)
        pointer = client.opened(memory.handle)
        answer = client(
            f"(cuda.Memcpy2D(host, 10, {pointer} + 16, 24, 8, 10, D2H), bytes(host[:100]).hex())"
        )
        rows = [image[24 * r : 24 * r + 8] for r in range(10)]
        assert answer[0] == 0
        assert [bytes.fromhex(answer[1])[10 * r :][:8] for r in range(10)] == rows
        last = client(f"cuda.Memcpy2D(host, 10, {pointer}, 64, 8, 8, D2H)")
        beyond = client(f"cuda.Memcpy2D(host, 10, {pointer} + 57, 64, 8, 8, D2H)")
        assert (last, beyond) == (0, 1), "one byte beyond the end"
        huge = client(f"cuda.Memcpy2D(host, 1 << 63, {pointer}, 1 << 63, 8, 3, D2H)")
        assert huge == 1, "an extent beyond 64 bits"
        calls = [call for call in it.calls() if call.function == "cudaMemcpy2D"]
    assert [call.code for call in calls] == [0, 0, 1, 1]
    first = calls[0]
    assert (first.memory, first.offset, first.pitch) == (memory.name, 16, 24)
    assert (first.width, first.height, first.to) == (8, 10, "")
    assert first.digest == zlib.adler32(b"".join(rows))


def test_the_host_cannot_touch_device_memory() -> None:
    with stand_in() as it, program(it) as client:
        pointer = client.opened(it.device.allocate(64).handle)
        client.send(f"ctypes.string_at({pointer}, 1)")
        assert client.leave() == -11, "as with a real device: SIGSEGV"


@pytest.mark.parametrize("wait", ["EventSynchronize({event})", "StreamWaitEvent(None, {event}, 0)"])
def test_who_waits_for_a_pending_event_reads_after_it(wait: str) -> None:
    with stand_in() as it, program(it) as client:
        memory, event = it.device.allocate(4), it.device.event()
        pointer, opened = client.opened(memory.handle), client.opened_event(event.handle)
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
        assert client(f"cuda.EventQuery({opened})") == 0


def test_an_event_of_another_process_is_done_when_recorded() -> None:
    with stand_in() as it, program(it) as server, program(it) as client:
        made = server(
            "(e := cuda.interprocess_event(), as_text(cuda.handle('IpcGetEventHandle', e)))"
        )
        opened = client.opened_event(bytes.fromhex(made[1]))
        assert server(f"cuda.EventRecord({made[0]}, None)") == 0
        assert client(f"[cuda.EventQuery({opened}), cuda.EventSynchronize({opened})]") == [0, 0]
        assert client(f"cuda.EventRecord({opened}, None)") == 0
        assert server(f"cuda.EventQuery({made[0]})") == 0


def test_what_a_process_leaves_behind_is_removed_when_it_ends() -> None:
    with stand_in() as it, program(it) as server:
        server("(cuda.made('Malloc', 64), cuda.interprocess_event(), cuda.made('EventCreate'))")
        assert len(list(it.device.folder.iterdir())) == 3
        server.leave()
        assert not list(it.device.folder.iterdir())
        assert it.calls()[-1].function == "cudaExit"


def test_threads_share_it() -> None:
    line = (
        "[t.join() for t in [(t.start(), t)[1] for t in [__import__('threading').Thread(target="
        "lambda: [cuda.Free(cuda.made('Malloc', 64)) for _ in range(50)]) for _ in range(4)]]]"
    )
    with stand_in() as it, program(it) as client:
        assert client(line) == [None] * 4
        assert sum(call.function == "cudaFree" and call.ok for call in it.calls()) == 200
