"""What it takes to bring an image to textures of OpenGL and draw it, from a GPU and from the host.

`gl_viewer` of the C++ client, without a window, beside a server in a process of its own whose image
is there already. `cuda`: the image lies on the GPU, and is copied there, by graphics
interoperability. `host`: it lies in memory of the host, and is uploaded. Both take turns; a figure
is the mean of 500 images, from the moment at which they can be read until they are drawn, and the
median of all rounds is told. The pictures of both are to be equal.

    python -m benchmarks cuda_gl [--rounds 5] [--size 1920x1080]
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks import _cuda, _shared
from benchmarks._cuda import Buffer, Device, api, call

IMAGES = 500
CPP = _shared.ROOT / "reference_client" / "cpp"
KINDS = ("cuda", "host")


def serve(kind: str, width: int, height: int, when: str) -> None:
    """A server until it is told to end: prints its ports, and publishes one image on and on.

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
        while True:
            if view := bus.next_view(0.05, contents_changed=when == "always"):
                if size != (view.width, view.height):
                    size, image = (view.width, view.height), planes((view.width, view.height))
                bus.publish(view, *image)


@contextmanager
def serving(kind: str, size: tuple[int, int], when: str) -> Iterator[tuple[int, int]]:
    """Such a server in another process: its IPC and its message port."""
    with _shared.calling("cuda_gl", "serve", kind, *size, when) as process:
        ipc, message = map(int, _shared.heard(process).split())
        yield ipc, message


def where(ports: tuple[int, int]) -> dict[str, str]:
    """The environment of a client of a server."""
    ipc, message = ports
    return os.environ | {"SPLATBUS_IPC_PORT": str(ipc), "SPLATBUS_MSG_PORT": str(message)}


def uploaded(plane: Any) -> Buffer:
    with Device(0).current():
        buffer = Buffer(plane.shape)
        call(api.cuMemcpyHtoD, buffer.pointer, plane.ctypes.data, plane.nbytes)
    return buffer


def compiled(program: str, to: Path, *options: str) -> None:
    """A program of the C++ client."""
    line = ["g++", "-std=c++17", "-O2", f"-I{CPP / 'include'}", "-pthread"]
    source = str(CPP / "programs" / f"{program}.cpp")
    subprocess.run([*line, source, "-o", str(to), *options], check=True)


def milliseconds(program: Path, kind: str, size: tuple[int, int], picture: Path) -> float:
    with serving(kind, size, "always") as ports:
        line = [str(program), str(picture), str(IMAGES)]
        done = subprocess.run(line, env=where(ports), capture_output=True, text=True, timeout=300)
    found = re.search(r"images from (CUDA|memory of the host), ([\d.]+) ms each", done.stdout)
    assert found, done.stdout + done.stderr
    assert (found[1] == "CUDA") == (kind == "cuda")
    return float(found[2])


def main() -> None:
    given = _shared.options(__doc__, rounds=5, size="1920x1080")
    _cuda.require_gpu()
    with tempfile.TemporaryDirectory() as scratch:
        program = Path(scratch) / "gl_viewer"
        compiled("gl_viewer", program, "-lEGL", "-lOpenGL")
        pictures = {kind: Path(scratch) / f"{kind}.png" for kind in KINDS}
        took: dict[str, list[float]] = {kind: [] for kind in KINDS}
        for _ in range(given.rounds):
            for kind in KINDS:
                took[kind].append(milliseconds(program, kind, given.size, pictures[kind]))
        assert pictures["cuda"].read_bytes() == pictures["host"].read_bytes()
    rows = [
        _shared.told({"from": kind, "ms": statistics.median(ms), "least": min(ms), "most": max(ms)})
        for kind, ms in took.items()
    ]
    _cuda.write("cuda_gl", {"images": IMAGES, "rows": rows})


if __name__ == "__main__":
    main()
