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

import argparse
import ctypes
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from benchmarks._cuda import RESULTS, ROOT, Buffer, Kernel, require_gpu, write
from benchmarks._pictures import pyplot, save

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
    """Publishes until its input ends; then prints how much and how fast."""
    import splatbus_server
    from splatbus_server.cuda.driver import Device, api, call

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
        ended = _end_of_input()
        count, start = 0, 0.0
        while not ended():
            view = bus.next_view(0.1, contents_changed=True)
            if view is None:
                continue
            start = start or time.monotonic()
            count += 1
            paint(width * height, int(stream), *pointers, count, width, height)
            bus.publish(view, color, depth, time=float(count), stream=int(stream))
            if waits:
                call(api.cuStreamSynchronize, stream)
        call(api.cuStreamSynchronize, stream)
        print(count, time.monotonic() - start, flush=True)


def _end_of_input() -> Any:
    import threading

    event = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        event.set()

    threading.Thread(target=wait, daemon=True).start()
    return event.is_set


def stall(ports: list[int]) -> None:
    """Takes a frame and holds it."""
    import splatbus_client

    with (
        splatbus_client.connect("127.0.0.1", *ports) as session,
        session.next_frame(30) as frame,
    ):
        print(frame.seq, flush=True)
        sys.stdin.read()


@contextmanager
def process(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "benchmarks.cuda_torn", *map(str, arguments)]
    with subprocess.Popen(
        command, cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        try:
            yield child
        finally:
            child.kill()


def read(
    ports: list[int], reads: int, seconds: float, width: int, height: int, too_late: bool
) -> dict[str, Any]:
    """Checks frames as they come, or once they were given back; what was found of them."""
    import splatbus_client
    from splatbus_server.cuda.driver import Device, api, call

    device = Device(0)
    with device.current(), splatbus_client.connect("127.0.0.1", *ports) as session:
        stream = int(call(api.cuStreamCreate, 1))
        check = Kernel(SOURCE, "check", device)
        wrong = Buffer((2,))
        on_host = (ctypes.c_uint * 2).from_address(int(call(api.cuMemAllocHost, 8)))
        count = torn = mismatched = 0
        first = last = None
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
        "published_meanwhile": (last or 0) - (first or 0),
        "published_per_second": round(((last or 0) - (first or 0)) / lasted, 1),
    }


def measure(
    waits: bool, reads: int, seconds: float, width: int, height: int, too_late: bool = False
) -> dict[str, Any]:
    with ExitStack() as stack:
        size = f"{width}x{height}"
        way = "host" if waits else "events"
        server = stack.enter_context(process("--serve", way, "--size", size))
        assert server.stdout
        ports = [int(port) for port in server.stdout.readline().split()]
        stalled = stack.enter_context(process("--stall", *ports))
        assert stalled.stdout
        held = int(stalled.stdout.readline())
        found = read(ports, reads, seconds, width, height, too_late)
    row = {"ordered_by": way, "size": size, "read_after_release": too_late}
    return row | found | {"stalled_reader_holds": held}


def draw(rows: list[dict[str, Any]]) -> None:
    plt = pyplot()
    figure, axis = plt.subplots(figsize=(9.5, 3.8))
    for offset, name in enumerate(("published_per_second", "reads_per_second")):
        places = [row + 0.4 * (offset - 0.5) for row in range(len(rows))]
        bars = axis.bar(places, [r[name] for r in rows], width=0.38, label=name.replace("_", " "))
        axis.bar_label(bars, fmt="%.0f", fontsize=8)
    labels = [
        f"{r['size']}, ordered by {r['ordered_by']}"
        f"{', READ TOO LATE' if r['read_after_release'] else ''}\n"
        f"{r['reads']:,} reads checked: {r['torn']} torn, {r['mismatched']} mismatched"
        for r in rows
    ]
    axis.set_xticks(range(len(rows)), labels, fontsize=8)
    axis.set_ylabel("frames a second")
    axis.set_yscale("log")
    axis.set_ylim(bottom=100, top=max(r["published_per_second"] for r in rows) * 4)
    axis.legend(fontsize=8, loc="upper right")
    axis.set_title(
        "A server without a pause, a reader that checks, a reader that stalls", fontsize=10
    )
    figure.tight_layout()
    save(figure, RESULTS / "cuda_torn.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reads", type=int, default=100_000)
    parser.add_argument("--seconds", type=float, default=200.0)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--serve", choices=("host", "events"), help=argparse.SUPPRESS)
    parser.add_argument("--stall", type=int, nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    if options.serve:
        serve(width, height, options.serve == "host")
        return
    if options.stall:
        stall(options.stall)
        return
    require_gpu()
    rows = [measure(True, 2000, options.seconds, width, height, too_late=True)]
    print(rows[-1], flush=True)
    for waits in (True, False):
        rows.append(measure(waits, options.reads, options.seconds, width, height))
        print(rows[-1], flush=True)
        write("cuda_torn", {"rows": rows})
    draw(rows)


if __name__ == "__main__":
    main()
