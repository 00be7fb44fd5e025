"""How long after a pose is sent has its frame been read, against what the machine allows?

`frame`: a client sends a camera pose; the server renders (nothing: its image is there already),
publishes and announces the frame; the client takes it, copies colour and depth to memory of its own
on the GPU, and sees that the copy is done.

`floor`: the same two processes, over a socket of their own: the client sends as many bytes as a
pose has; the server copies as many bytes as an image has on the GPU, records an event that both
have, and sends as many bytes as a frame has; the client's stream waits for the event, copies, and
is waited for. Both take turns.

    python -m benchmarks cuda_latency [--rounds 20] [--size 1920x1080]
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np

from benchmarks._cuda import PIXEL_BYTES, RESULTS, ROOT, Buffer, require_gpu, write
from benchmarks._pictures import pyplot, save

POSE_BYTES, FRAME_BYTES, HANDLE_BYTES = 190, 330, 64
IN_A_ROW = 50
GOAL_MS, GOAL_RATIO = 0.8, 2.0


def receive(connection: socket.socket, count: int) -> bytes:
    data = b""
    while len(data) < count:
        more = connection.recv(count - len(data))
        if not more:
            raise ConnectionError
        data += more
    return data


def serve_floor(listener: socket.socket, size: int, device: Any) -> None:
    """Copies and answers, on a thread of its own, as the I/O thread of a server is one."""
    from splatbus_server.cuda.driver import (
        api,
        call,
        event_handle,
        interprocess_event,
        memory_handle,
    )

    connection, _ = listener.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with device.current():
        image, shared = Buffer((size // 4,)), Buffer((size // 4,))
        event = interprocess_event()
        stream = call(api.cuStreamCreate, 1)
        connection.sendall(memory_handle(shared.pointer) + event_handle(event))
        answer = bytes(FRAME_BYTES)
        try:
            while True:
                receive(connection, POSE_BYTES)
                call(api.cuMemcpyDtoDAsync, shared.pointer, image.pointer, size, stream)
                call(api.cuEventRecord, event, stream)
                connection.sendall(answer)
        except OSError:
            return


def serve(width: int, height: int) -> None:
    import splatbus_server
    from splatbus_server.cuda.driver import Device

    sys.setswitchinterval(0.0005)
    device = Device(0)
    listener = socket.create_server(("127.0.0.1", 0))
    size = PIXEL_BYTES * width * height
    threading.Thread(target=serve_floor, args=(listener, size, device), daemon=True).start()
    with (
        splatbus_server.serve(width, height, memory="cuda_ipc", ipc_port=0, message_port=0) as bus,
        device.current(),
    ):
        color, depth = Buffer((height, width, 4)), Buffer((height, width))
        print(*bus.address[1:], listener.getsockname()[1], flush=True)
        while True:
            view = bus.next_view(1.0)
            if view is not None:
                bus.publish(view, color, depth)


class Floor:
    """The client's side of `serve_floor`."""

    def __init__(self, port: int, size: int, target: int, stream: int, device: Any) -> None:
        from splatbus_client.cuda.driver import api, call, filled
        from splatbus_client.cuda.opened import open_memory

        self._size, self._target, self._stream = size, target, stream
        self._connection = socket.create_connection(("127.0.0.1", port))
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        handles = receive(self._connection, 2 * HANDLE_BYTES)
        self._memory = open_memory(device, handles[:HANDLE_BYTES]).pointer
        event = filled(api.CUipcEventHandle(), handles[HANDLE_BYTES:])
        self._event = call(api.cuIpcOpenEventHandle, event)

    def __call__(self, number: int) -> None:
        from splatbus_client.cuda.driver import api, call

        self._connection.sendall(bytes(POSE_BYTES))
        receive(self._connection, FRAME_BYTES)
        call(api.cuStreamWaitEvent, self._stream, self._event, 0)
        call(api.cuMemcpyDtoDAsync, self._target, self._memory, self._size, self._stream)
        call(api.cuStreamSynchronize, self._stream)


class Frames:
    """A pose out, its frame in."""

    def __init__(self, session: Any, width: int, height: int, target: int, stream: int) -> None:
        self._session, self._target, self._stream = session, target, stream
        self._color, self._depth = 16 * width * height, 4 * width * height

    def __call__(self, number: int) -> None:
        from splatbus_client import Pose
        from splatbus_client.cuda.driver import api, call

        pose = Pose((number / 1024, 0.5, -4.0), (0.0, 0.0, 0.0, 1.0))
        self._session.send_camera(pose)
        stream, target = self._stream, self._target
        while True:
            with self._session.next_frame(10.0) as frame:
                if frame.camera.pose == pose:
                    color = frame.color_on_device.ready_on(stream)
                    depth = frame.depth_on_device.pointer
                    call(api.cuMemcpyDtoDAsync, target, color, self._color, stream)
                    call(api.cuMemcpyDtoDAsync, target + self._color, depth, self._depth, stream)
                    call(api.cuStreamSynchronize, stream)
                    return


def measure(width: int, height: int, rounds: int) -> dict[str, Any]:
    import splatbus_client
    from splatbus_client.cuda.driver import Device, api, call

    command = [sys.executable, "-m", "benchmarks.cuda_latency", "--serve"]
    command += ["--size", f"{width}x{height}"]
    times: dict[str, list[float]] = {"floor": [], "frame": []}
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout
            *ports, floor_port = (int(port) for port in server.stdout.readline().split())
            call(api.cuInit, 0)
            device = Device(0)
            size = PIXEL_BYTES * width * height
            with device.current(), splatbus_client.connect("127.0.0.1", *ports) as session:
                target = int(call(api.cuMemAlloc, size))
                stream = int(call(api.cuStreamCreate, 1))
                ways = {
                    "floor": Floor(floor_port, size, target, stream, device),
                    "frame": Frames(session, width, height, target, stream),
                }
                number = 0
                for _ in range(rounds + 1):
                    for name, work in ways.items():
                        for _ in range(IN_A_ROW):
                            number += 1
                            start = time.perf_counter()
                            work(number)
                            times[name].append((time.perf_counter() - start) * 1e3)
        finally:
            server.kill()
    row: dict[str, Any] = {"width": width, "height": height}
    for name, found in times.items():
        p50, p99 = (round(float(p), 4) for p in np.percentile(found[IN_A_ROW:], [50, 99]))
        row[name] = {"p50_ms": p50, "p99_ms": p99, "times": rounds * IN_A_ROW}
    row["ratio_p50"] = round(row["frame"]["p50_ms"] / row["floor"]["p50_ms"], 2)
    return row


def draw(rows: list[dict[str, Any]]) -> None:
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(7.5, 3.8))
    bars = [(w, p) for w in ("floor", "frame") for p in ("p50_ms", "p99_ms")]
    for offset, (who, percentile) in enumerate(bars):
        places = [row + 0.2 * (offset - 1.5) for row in range(len(rows))]
        heights = [row[who][percentile] for row in rows]
        drawn = axis.bar(places, heights, width=0.19, label=f"{who}, {percentile[:3]}")
        axis.bar_label(drawn, fmt="%.2g", fontsize=8)
    labels = [f"{r['width']}×{r['height']}\np50 ×{r['ratio_p50']}" for r in rows]
    axis.set_xticks(range(len(rows)), labels)
    axis.axhline(GOAL_MS, color="black", linewidth=0.8, linestyle="--")
    axis.set_xlim(-0.5, len(rows) + 0.1)
    axis.text(
        len(rows) + 0.08, GOAL_MS * 1.02, f"goal at\n1080p:\n{GOAL_MS} ms", ha="right", fontsize=8
    )
    axis.set_ylabel("pose sent until frame read (ms)")
    axis.legend(fontsize=8)
    figure.tight_layout()
    save(figure, RESULTS / "cuda_latency.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--size", default="", help="one size, such as 1920x1080")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(*map(int, options.size.split("x")))
        return
    require_gpu()
    sizes = [options.size] if options.size else ["1280x720", "1920x1080", "3840x2160"]
    rows = []
    for size in sizes:
        width, height = map(int, size.split("x"))
        rows.append(measure(width, height, options.rounds))
        print(rows[-1], flush=True)
    write("cuda_latency", {"goal_p50_ms_1080p": GOAL_MS, "goal_ratio": GOAL_RATIO, "rows": rows})
    draw(rows)


if __name__ == "__main__":
    main()
