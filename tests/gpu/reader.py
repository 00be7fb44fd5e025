"""Clients in a process of their own: `python -m tests.gpu.reader WHAT IPC_PORT MESSAGE_PORT`.

Each prints what it saw, as JSON.
"""

from __future__ import annotations

import base64
import json
import socket
import sys
import time
from typing import Any

import numpy as np
from splatbus_client import connect


def corners(color: Any, depth: Any) -> dict[str, Any]:
    """The pixels at the ends of the image's first and last row, the top one first."""
    return {
        "color": color[[0, 0, -1, -1], [0, -1, 0, -1]].tolist(),
        "depth": depth[[0, 0, -1, -1], [0, -1, 0, -1]].tolist(),
    }


def host(ports: list[int]) -> Any:
    """The frame, copied to the host."""
    with connect("127.0.0.1", *ports) as session, session.next_frame(20) as frame:
        once = frame.color
        assert once is frame.color
        assert not once.flags.writeable
        return corners(once, frame.depth) | {"time": frame.time, "intact": frame.intact}


def device(ports: list[int]) -> Any:
    """The frame where it lies: by DLPack in PyTorch, by the array interface in CuPy."""
    import cupy
    import torch

    with connect("127.0.0.1", *ports) as session:
        with session.next_frame(20) as frame:
            color = torch.from_dlpack(frame.color_on_device).flip(0).cpu().numpy()
            depth = cupy.asnumpy(cupy.asarray(frame.depth_on_device)[::-1])
            same = np.array_equal(color, frame.color) and np.array_equal(depth, frame.depth)
        with session.next_frame(20) as frame:
            again = torch.from_dlpack(frame.color_on_device)
            assert again.data_ptr() == frame.color_on_device.pointer
        return corners(color, depth) | {"same": bool(same)}


def slow(ports: list[int]) -> Any:
    """Reads that are still under way on the GPU when the frame is given back."""
    import torch

    stream = torch.cuda.Stream()
    copy = torch.empty((48, 64, 4), device="cuda")
    with connect("127.0.0.1", *ports) as session:
        with session.next_frame(20) as frame, torch.cuda.stream(stream):
            torch.cuda._sleep(500_000_000)
            copy.copy_(torch.from_dlpack(frame.color_on_device))
            before = stream.query()
        return {"before": before, "after": stream.query()}


def resized(ports: list[int]) -> Any:
    """Two sizes, one after the other."""
    shapes: list[Any] = []
    end = time.monotonic() + 20
    with connect("127.0.0.1", *ports) as session:
        while len(shapes) < 2 and time.monotonic() < end:
            with session.next_frame(20) as frame:
                if not shapes or shapes[-1] != frame.color.shape:
                    shapes.append(frame.color.shape)
                    print(json.dumps(frame.color.shape), flush=True)
        time.sleep(1.0)  # in which the old memory is closed
    return shapes


def legacy(ports: list[int]) -> Any:
    """A client of 1.0: says nothing, copies what the legacy slot holds."""
    from splatbus_client.cuda.driver import api, call, device, filled
    from splatbus_client.cuda.opened import open_memory

    with socket.create_connection(("127.0.0.1", ports[0])) as connection:
        stream = connection.makefile("rb")
        packet = json.loads(stream.read(int.from_bytes(stream.read(4), "little")))
        meta = packet["meta"]
        handle = base64.b64decode(packet["mem_color"])
        where = device(packet["memory"]["deviceUuid"])
        with where.current():
            base = open_memory(where, handle).pointer
            event = filled(api.CUipcEventHandle(), base64.b64decode(packet["evt_done"]))
            event = call(api.cuIpcOpenEventHandle, event)
            color = np.zeros((meta["h"], meta["w"], 4), np.float32)
            depth = np.zeros((meta["h"], meta["w"]), np.float32)
            end = time.monotonic() + 20
            while not color.any() and time.monotonic() < end:
                for array, offset in (color, meta["offsetColor"]), (depth, meta["offsetDepth"]):
                    call(api.cuStreamWaitEvent, 0, event, 0)
                    source = base + offset
                    call(api.cuMemcpyDtoHAsync, array.ctypes.data, source, array.nbytes, 0)
                    call(api.cuStreamSynchronize, 0)
        return corners(color[::-1], depth[::-1]) | {
            "same": packet["mem_depth"] == packet["mem_color"]
        }


if __name__ == "__main__":
    what, *ports = sys.argv[1:]
    print(json.dumps(globals()[what](list(map(int, ports)))), flush=True)
