"""What it takes to bring an image to textures of OpenGL and draw it, from a GPU and from the host.

`gl_viewer` of the C++ client, without a window, beside a server in a process of its own whose image
is there already. `cuda`: the image lies on the GPU, and is copied there, by graphics
interoperability. `host`: it lies in memory of the host, and is uploaded. Both take turns; a figure
is the mean of 500 images, from the moment at which they can be read until they are drawn, and the
median of all rounds is told. The pictures of both are to be equal.

    python -m benchmarks cuda_gl [--rounds 5] [--size 1920x1080]
"""

from __future__ import annotations

import argparse
import os
import re
import select
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks._cuda import ROOT, Buffer, require_gpu, write

IMAGES = 500
CPP = ROOT / "reference_client" / "cpp"
KINDS = ("cuda", "host")


def serve(kind: str, width: int, height: int, when: str = "always") -> None:
    """A server until its input ends: prints its ports, and publishes one image on and on.

    Or `"asked"` for another view.
    """
    import splatbus_server

    def planes(size: tuple[int, int]) -> list[Any]:
        noise = np.random.default_rng(0)
        color = noise.random((size[1], size[0], 4), np.float32)
        both: list[Any] = [color, 3 + 4 * noise.random((size[1], size[0]), np.float32)]
        return [uploaded(plane) for plane in both] if kind == "cuda" else both

    memory: Literal["cuda_ipc", "host_shm"] = "cuda_ipc" if kind == "cuda" else "host_shm"
    with splatbus_server.serve(width, height, ipc_port=0, message_port=0, memory=memory) as bus:
        size, image = (width, height), planes((width, height))
        print(bus.address.ipc_port, bus.address.message_port, flush=True)
        while not select.select([sys.stdin], [], [], 0)[0]:
            if view := bus.next_view(0.05, contents_changed=when == "always"):
                if size != (view.width, view.height):
                    size, image = (view.width, view.height), planes((view.width, view.height))
                bus.publish(view, *image)


@contextmanager
def serving(kind: str, size: tuple[int, int], when: str) -> Iterator[tuple[int, int]]:
    """Such a server in another process: its IPC and its message port."""
    line = [sys.executable, "-m", "benchmarks.cuda_gl", "--as-server", kind, *map(str, size), when]
    pipe = subprocess.PIPE
    with subprocess.Popen(line, cwd=ROOT, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin
        assert process.stdout
        ipc, message = map(int, process.stdout.readline().split())
        yield ipc, message
        process.stdin.close()


def uploaded(plane: Any) -> Buffer:
    from splatbus_server.cuda.driver import Device, api, call

    with Device(0).current():
        buffer = Buffer(plane.shape)
        call(api.cuMemcpyHtoD, buffer.pointer, plane.ctypes.data, plane.nbytes)
    return buffer


def milliseconds(program: Path, kind: str, size: tuple[int, int], picture: Path) -> float:
    with serving(kind, size, "always") as (ipc, message):
        where = os.environ | {"SPLATBUS_IPC_PORT": str(ipc), "SPLATBUS_MSG_PORT": str(message)}
        done = subprocess.run(
            [program, picture, str(IMAGES)], env=where, capture_output=True, text=True, timeout=300
        )
    found = re.search(r"images from (CUDA|memory of the host), ([\d.]+) ms each", done.stdout)
    assert found, done.stdout + done.stderr
    assert (found[1] == "CUDA") == (kind == "cuda")
    return float(found[2])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks cuda_gl")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--as-server", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.as_server:
        kind, width, height, *when = given.as_server
        serve(kind, int(width), int(height), *when)
        return
    require_gpu()
    width, height = map(int, given.size.split("x"))
    with tempfile.TemporaryDirectory() as scratch:
        program = Path(scratch) / "gl_viewer"
        line = ["g++", "-std=c++17", "-O2", f"-I{CPP / 'include'}", "-pthread"]
        line += [str(CPP / "programs" / "gl_viewer.cpp"), "-o", str(program), "-lEGL", "-lOpenGL"]
        subprocess.run(line, check=True)
        pictures = {kind: Path(scratch) / f"{kind}.png" for kind in KINDS}
        took: dict[str, list[float]] = {kind: [] for kind in KINDS}
        for number in range(given.rounds):
            for kind in KINDS:
                found = milliseconds(program, kind, (width, height), pictures[kind])
                print(f"round {number + 1}, {kind}: {found} ms", flush=True)
                took[kind].append(found)
        assert pictures["cuda"].read_bytes() == pictures["host"].read_bytes()
    rows = [
        {"from": kind, "ms": statistics.median(each), "least": min(each), "most": max(each)}
        for kind, each in took.items()
    ]
    write("cuda_gl", {"images": IMAGES, "rows": rows})


if __name__ == "__main__":
    main()
