"""Images in memory of a GPU, here the stand-in's, where the harness does not look."""

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage, text_of
from splatbus_conformance.images.memory.cuda_stand_in.usage import held

from tests.conformance.images.cuda_stand_in.library import stand_in
from tests.engines.built import Command, answers, built
from tests.engines.stage import Answer, asked
from tests.wire.payloads import payload
from tests.wire.test_init_packet import CUDA, with_value

LIMIT_SECONDS = 60
NOBODY = "01234567-89ab-cdef-0123-456789abcdef"


@contextmanager
def serving(image: DeviceImage) -> Iterator[dict[str, str]]:
    """A server of 1.0 with this image; where its clients are to connect."""
    text = payload(image.init_packet())
    packet = len(text).to_bytes(4, "little") + text
    with ExitStack() as stack:
        ports = {}
        for name, first in (("IPC", packet), ("MSG", b"")):
            listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
            ports[f"SPLATBUS_{name}_PORT"] = str(listener.getsockname()[1])
            threading.Thread(target=stay, args=(listener, first), daemon=True).start()
        yield ports


def stay(listener: socket.socket, first: bytes) -> None:
    """Say it to the one client, and take what it says until it leaves."""
    client, _ = listener.accept()
    with client:
        client.sendall(first)
        while client.recv(65_536):
            pass


@pytest.mark.parametrize("how", [(), ("device",)])
def test_each_look_is_at_what_lies_there_then(how: tuple[str, ...], cpp_adapter: Command) -> None:
    with stand_in() as it:
        image = DeviceImage(it.device)
        image.draw(0)
        line = [*cpp_adapter, "opengl", *how]
        with (
            serving(image) as ports,
            asked(line, it.environment() | ports, greets=True) as ask,
        ):
            ask(json.dumps({"id": 1, "command": "start"}))
            seqs = []
            for number in range(3):
                image.draw(number)
                until = time.monotonic() + LIMIT_SECONDS
                shown: Answer = {}
                while digests(image) != [shown.get(each) for each in ("color", "depth")]:
                    assert time.monotonic() < until, f"image {number} is not seen"
                    shown = ask(json.dumps({"id": 2, "command": "digest"}))
                seqs.append(shown["seq"])
            told = ask(json.dumps({"id": 3, "command": "init_packet"}))
            ask(json.dumps({"id": 4, "command": "stop"}))
    assert sorted(set(seqs)) == seqs, "each copy has a number of its own"
    meaning = told["images"]["semantics"]
    assert (told["images"]["width"], meaning["alpha"], meaning["depth"]["empty"]) == (
        *(64, "straight"),
        "inf",
    )


def test_what_cannot_be_opened_is_refused_and_why(tmp_path: Path) -> None:
    """[MEM-6, MEM-17, INI-13]"""
    with stand_in() as it:
        legacy = DeviceImage(it.device).init_packet()
        plane, event = it.device.allocate(2 * 20_480), it.device.event()
        ring = {
            "slots": 2,
            "colorOffset": 0,
            "colorStride": 16_384,
            "depthOffset": 32_768,
            "depthStride": 4_096,
            "events": 2 * [text_of(event.handle)],
        }
        memory = {"kind": "cuda_ipc", "deviceUuid": it.device.uuid, "bytes": 2 * 20_480}
        memory["handle"] = text_of(plane.handle)
        good = CUDA | legacy | {"memory": memory, "ring": ring}
        good["meta"] = legacy["meta"] | {"w": 32, "h": 32, "pitchColor": 512, "pitchDepth": 128}
        gone = it.device.allocate(20_480)
        gone.free()
        beyond = 16 * 64 * 48 + 4
        cases = {
            "open": [good, DeviceImage(it.device).init_packet()],
            "memory is 40960 bytes long, 40961 were announced [MEM-6]": [
                with_value(good, "/memory/bytes", 40_961)
            ],
            "an image ends beyond the memory of 61440 bytes": [
                with_value(legacy, "/meta/offsetDepth", beyond)
            ],
            "this process sees GPU-": [with_value(good, "/memory/deviceUuid", f"GPU-{NOBODY}")],
            "this process sees 2": [with_value(legacy, "/meta/device", 2)],
            "cuIpcOpenMemHandle: invalid argument (CUDA_ERROR_INVALID_VALUE); it was freed": [
                with_value(good, "/memory/handle", text_of(gone.handle)),
                with_value(legacy, "/mem_depth", text_of(gone.handle)),
            ],
            "cuIpcOpenEventHandle: mapping of buffer object failed": [
                with_value(good, "/ring/events/1", text_of(plane.handle)),
                with_value(legacy, "/evt_done", text_of(plane.handle)),
            ],
        }
        program = [*built("cpp", "Tests", tmp_path), "--open"]
        payloads = [payload(packet) for packets in cases.values() for packet in packets]
        told = answers(program, payloads, it.environment())
        opened = {call for call in it.calls() if call.function == "cudaIpcOpenMemHandle"}
        assert opened
        assert held(it.calls()) == set(), "what was opened before it failed is closed"
    wanted = [why for why, packets in cases.items() for _ in packets]
    assert [why in each for why, each in zip(wanted, told, strict=True)] == len(told) * [True], told


def digests(image: DeviceImage) -> list[str]:
    """Of the planes, rows from the top."""
    painted = image.painting()
    return [
        sha256(np.ascontiguousarray(each).tobytes()).hexdigest()
        for each in (painted.color, painted.depth)
    ]
