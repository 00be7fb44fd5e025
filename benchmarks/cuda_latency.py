"""How long after a pose is sent has its frame been read, against what the machine allows?

`frame`: a client sends a camera pose; the server renders (nothing: its image is there already),
publishes and announces the frame; the client takes it, copies colour and depth to memory of its own
on the GPU, and sees that the copy is done.

`floor`: the same two processes, over a socket of their own: the client sends as many bytes as a
pose has; the server copies as many bytes as an image has on the GPU, records an event that both
have, and sends as many bytes as a frame has; the client's stream waits for the event, copies, and
is waited for. Both take turns.

    python -m benchmarks cuda_latency [--rounds 20]
"""

from __future__ import annotations

import socket
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks import _cuda, _shared
from benchmarks._cuda import Buffer, Device, api, call

POSE_BYTES, FRAME_BYTES, HANDLE_BYTES = 190, 330, 64
IN_A_ROW = 50
GOAL_MS, GOAL_RATIO = 0.8, 2.0
Way = Callable[[int], None]


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
    from splatbus_server.cuda.driver import event_handle, interprocess_event, memory_handle

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

    sys.setswitchinterval(0.0005)
    device = Device(0)
    listener = socket.create_server(("127.0.0.1", 0))
    size = _cuda.PIXEL_BYTES * width * height
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


def floor(port: int, size: int, target: int, stream: int, device: Any) -> Way:
    """The client's side of `serve_floor`."""
    from splatbus_client.cuda.driver import filled
    from splatbus_client.cuda.opened import open_memory

    connection = socket.create_connection(("127.0.0.1", port))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    handles = receive(connection, 2 * HANDLE_BYTES)
    memory = open_memory(device, handles[:HANDLE_BYTES]).pointer
    event = filled(api.CUipcEventHandle(), handles[HANDLE_BYTES:])
    event = call(api.cuIpcOpenEventHandle, event)

    def work(number: int) -> None:
        connection.sendall(bytes(POSE_BYTES))
        receive(connection, FRAME_BYTES)
        call(api.cuStreamWaitEvent, stream, event, 0)
        call(api.cuMemcpyDtoDAsync, target, memory, size, stream)
        call(api.cuStreamSynchronize, stream)

    return work


def frames(session: Any, pixels: int, target: int, stream: int) -> Way:
    """A pose out, its frame in."""
    from splatbus_client import Pose

    def work(number: int) -> None:
        pose = Pose((number / 1024, 0.5, -4.0), (0.0, 0.0, 0.0, 1.0))
        session.send_camera(pose)
        while True:
            with session.next_frame(10.0) as frame:
                if frame.camera.pose == pose:
                    color = frame.color_on_device.ready_on(stream)
                    depth = frame.depth_on_device.pointer
                    call(api.cuMemcpyDtoDAsync, target, color, 16 * pixels, stream)
                    call(api.cuMemcpyDtoDAsync, target + 16 * pixels, depth, 4 * pixels, stream)
                    call(api.cuStreamSynchronize, stream)
                    return

    return work


def measure(width: int, height: int, rounds: int) -> dict[str, Any]:
    import splatbus_client

    times: dict[str, list[float]] = {"floor": [], "frame": []}
    with _shared.calling("cuda_latency", "serve", width, height) as server:
        *ports, floor_port = (int(port) for port in _shared.heard(server).split())
        device = Device(0)
        size = _cuda.PIXEL_BYTES * width * height
        with device.current(), splatbus_client.connect("127.0.0.1", *ports) as session:
            target = int(call(api.cuMemAlloc, size))
            stream = int(call(api.cuStreamCreate, 1))
            ways = {
                "floor": floor(floor_port, size, target, stream, device),
                "frame": frames(session, width * height, target, stream),
            }
            for begin in range(0, (rounds + 1) * IN_A_ROW, IN_A_ROW):
                for name, work in ways.items():
                    for number in range(begin, begin + IN_A_ROW):
                        times[name].append(_shared.wall_ms(partial(work, number)))
    row: dict[str, Any] = {"width": width, "height": height}
    row |= {name: _shared.percentiles(found[IN_A_ROW:]) for name, found in times.items()}
    row["ratio_p50"] = round(row["frame"]["p50_ms"] / row["floor"]["p50_ms"], 2)
    return _shared.told(row)


def main() -> None:
    options = _shared.options(__doc__, rounds=20)
    _cuda.require_gpu()
    sizes = list(_cuda.SIZES.values())[:3]
    rows = [measure(*size, options.rounds) for size in sizes]
    goals = {"goal_p50_ms_1080p": GOAL_MS, "goal_ratio": GOAL_RATIO}
    _cuda.write("cuda_latency", goals | {"rows": rows})
    groups = [f"{row['width']}×{row['height']}\np50 ×{row['ratio_p50']}" for row in rows]
    shown = _shared.trips(rows, ("floor", "frame"))
    title = f"pose sent until frame read, ms; goal at 1080p: {GOAL_MS}"
    _shared.draw_bars("cuda_latency", [_shared.Bars(title, groups, shown, [GOAL_MS])])


if __name__ == "__main__":
    main()
