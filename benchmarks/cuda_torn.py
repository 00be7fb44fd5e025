"""Is an image that is read on the GPU ever torn, or its colour of another moment than its depth?

A server publishes without a pause, a reader in another process checks every number of every frame
that it gets, on the GPU, and a third process holds a frame and stalls. Frame n has a pattern of n
in its colour and in its depth; a read is torn if one of its planes is partly of n, mismatched if
its planes are not both of n.

Two ways: `host`: the renderer waits for the GPU after each frame, as one does that reads a loss.
`events`: nobody waits for anything, so that only events order the work; the server is up to
hundreds of frames ahead of the GPU.

That the check can fail is shown first, by a reader that gives each frame back a millisecond before
it reads it.

    python -m benchmarks cuda_torn [--reads 100000] [--seconds 200] [--size 1920x1080]
"""

from __future__ import annotations

import ctypes
import time
from typing import Any

from benchmarks import _cuda, _shared
from benchmarks._cuda import Buffer, Device, Kernel, api, call

SOURCE = """
__device__ unsigned hashed(unsigned n, unsigned p) {
  unsigned h = n * 2654435761u ^ p * 2246822519u;
  h ^= h >> 15; h *= 2654435761u; h ^= h >> 13;
  return h;
}
__device__ float4 color_of(unsigned n, unsigned p) {
  const unsigned h = hashed(n, p);
  return make_float4((h & 0xffff) / 65536.0f, (h >> 16) / 65536.0f, (n & 0xffff) / 65536.0f, 1.0f);
}
__device__ float depth_of(unsigned n, unsigned p) {
  return 1.0f + (hashed(n + 1, p) >> 10) / 4194304.0f;
}
// The source has its top row first, the slot its bottom row.
extern "C" __global__ void paint(float4* color, float* depth, unsigned n, unsigned width,
                                 unsigned height) {
  const unsigned p = blockIdx.x * 256 + threadIdx.x;
  if (p >= width * height) return;
  const unsigned q = (height - 1 - p / width) * width + p % width;
  color[q] = color_of(n, p);
  depth[q] = depth_of(n, p);
}
extern "C" __global__ void check(const float4* color, const float* depth, unsigned* wrong,
                                 unsigned n, unsigned width, unsigned height) {
  const unsigned p = blockIdx.x * 256 + threadIdx.x;
  if (p >= width * height) return;
  const float4 c = color[p], e = color_of(n, p);
  if (c.x != e.x || c.y != e.y || c.z != e.z || c.w != e.w) atomicAdd(wrong, 1u);
  if (depth[p] != depth_of(n, p)) atomicAdd(wrong + 1, 1u);
}
"""


def serve(width: int, height: int, waits: bool) -> None:
    """Publishes until it is told to end."""
    import splatbus_server

    device = Device(0)
    with (
        splatbus_server.serve(
            width, height, memory="cuda_ipc", readers=2, ipc_port=0, message_port=0
        ) as bus,
        device.current(),
    ):
        stream = call(api.cuStreamCreate, 1)
        paint = Kernel(SOURCE, "paint", device)
        color, depth = Buffer((height, width, 4)), Buffer((height, width))
        pointers = ctypes.c_void_p(color.pointer), ctypes.c_void_p(depth.pointer)
        print(*bus.address[1:], flush=True)
        count = 0
        while True:
            view = bus.next_view(0.1, contents_changed=True)
            if view is None:
                continue
            count += 1
            paint(width * height, int(stream), *pointers, count, width, height)
            bus.publish(view, color, depth, time=float(count), stream=int(stream))
            if waits:
                call(api.cuStreamSynchronize, stream)


def read(
    ports: list[int], reads: int, seconds: float, width: int, height: int, too_late: bool
) -> dict[str, Any]:
    """Checks frames as they come, or once they were given back; what was found of them."""
    import splatbus_client

    device = Device(0)
    with device.current(), splatbus_client.connect("127.0.0.1", *ports) as session:
        stream = int(call(api.cuStreamCreate, 1))
        check = Kernel(SOURCE, "check", device)
        wrong = Buffer((2,))
        on_host = (ctypes.c_uint * 2).from_address(int(call(api.cuMemAllocHost, 8)))
        count = torn = mismatched = 0
        first = last = 0
        with session.next_frame(30):
            pass
        start = time.monotonic()
        while count < reads and time.monotonic() < start + seconds:
            with session.next_frame(30) as frame:
                number = int(frame.time)
                color = ctypes.c_void_p(frame.color_on_device.ready_on(stream))
                depth = ctypes.c_void_p(frame.depth_on_device.pointer)
                if too_late:
                    frame.release()
                    time.sleep(0.001)
                call(api.cuMemsetD32Async, wrong.pointer, 0, 2, stream)
                counters = ctypes.c_void_p(wrong.pointer)
                check(width * height, stream, color, depth, counters, number, width, height)
                call(api.cuMemcpyDtoHAsync, ctypes.addressof(on_host), wrong.pointer, 8, stream)
                call(api.cuStreamSynchronize, stream)
            planes = list(on_host)
            torn += any(0 < plane < width * height for plane in planes)
            mismatched += any(planes)
            count += 1
            first, last = first or number, number
        lasted = time.monotonic() - start
    return {
        "reads": count,
        "torn": torn,
        "mismatched": mismatched,
        "seconds": round(lasted, 2),
        "reads_per_second": round(count / lasted, 1),
        "published_per_second": round((last - first) / lasted, 1),
    }


def measure(
    waits: bool, reads: int, seconds: float, size: tuple[int, int], too_late: bool = False
) -> dict[str, Any]:
    with _shared.calling("cuda_torn", "serve", *size, waits) as server:
        ports = [int(port) for port in _shared.heard(server).split()]
        with _shared.calling("cuda_torn", "stall", ports) as stalled:
            held = int(_shared.heard(stalled))
            found = read(ports, reads, seconds, *size, too_late)
    row = {
        "ordered_by": "host" if waits else "events",
        "size": "{}x{}".format(*size),
        "read_after_release": too_late,
    }
    return _shared.told(row | found | {"stalled_reader_holds": held})


def stall(ports: list[int]) -> None:
    """Takes a frame and holds it until it is told to end."""
    import splatbus_client

    with (
        splatbus_client.connect("127.0.0.1", *ports) as session,
        session.next_frame(30) as frame,
    ):
        print(frame.seq, flush=True)
        while True:
            time.sleep(1.0)


def main() -> None:
    options = _shared.options(__doc__, reads=100_000, seconds=200.0, size="1920x1080")
    _cuda.require_gpu()
    rows = [measure(True, 2000, options.seconds, options.size, too_late=True)]
    for waits in (True, False):
        rows.append(measure(waits, options.reads, options.seconds, options.size))
        _cuda.write("cuda_torn", {"rows": rows})


if __name__ == "__main__":
    main()
