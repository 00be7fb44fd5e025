"""What the window does with an image of a GPU: from the frame to textures of OpenGL.

Without a display, in an OpenGL context of EGL, beside a server in a process of its own that
publishes one 1080p image whenever it is asked for another view. `window`: from the moment at which
a frame is there until its textures hold it. Its floor, `interop`: map, copy, unmap and wait for the
same bytes, from memory of our own. `copy`: a copy on the device alone.
`memory object`: a copy into a buffer of OpenGL that is CUDA's memory, shared by file descriptor,
and waited for by the host, since a semaphore that both know comes from Vulkan alone. Each in turn
comes after a frame of its own, as the GPU changes from the server's work to ours then, which takes
0.3 ms; medians. `pose`: from a pose that is sent until its image is drawn, over 1,000 poses.

    python -m benchmarks cuda_window [--rounds 300] [--size 1920x1080]
"""

from __future__ import annotations

import argparse
import ctypes
import os
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks._cuda import Buffer, require_gpu, write
from benchmarks.cuda_gl import serving

GOAL = 1.1
"""Times the floor."""
POSES = 1000
PLANES = {"color": ("color",), "color and depth": ("color", "depth")}
_FD_OF_POSIX, _OPAQUE_FD, _DEDICATED = 1, 0x9586, 0x9581


class Bare:
    """Graphics interoperability of the same bytes, and nothing else."""

    def __init__(self, context: Any, shapes: dict[str, tuple[int, ...]]) -> None:
        from splatbus_client.cuda.driver import api, call
        from splatbus_viewer.window.drawing.uploading import texture

        self.stream = call(api.cuStreamCreate, 1)
        self.parts = []
        for name, shape in shapes.items():
            made = texture(context, shape[1], shape[0], name)
            resource = call(api.cuGraphicsGLRegisterImage, made.glo, 0x0DE1, 2)
            self.parts.append((made, resource, Buffer(shape)))

    def __call__(self) -> None:
        from splatbus_client.cuda.driver import api, call

        for _, resource, buffer in self.parts:
            call(api.cuGraphicsMapResources, 1, resource, self.stream)
            copy = api.CUDA_MEMCPY2D()
            copy.srcMemoryType = api.CUmemorytype.CU_MEMORYTYPE_DEVICE
            copy.dstMemoryType = api.CUmemorytype.CU_MEMORYTYPE_ARRAY
            copy.srcDevice = buffer.pointer
            copy.srcPitch = copy.WidthInBytes = buffer.bytes // buffer.shape[0]
            copy.Height = buffer.shape[0]
            copy.dstArray = call(api.cuGraphicsSubResourceGetMappedArray, resource, 0, 0)
            call(api.cuMemcpy2DAsync, copy, self.stream)
            call(api.cuGraphicsUnmapResources, 1, resource, self.stream)
        call(api.cuStreamSynchronize, self.stream)


class Copy:
    """A copy on the device, of so many bytes, to where `target` says or to memory of our own."""

    def __init__(self, size: int, target: int | None = None) -> None:
        from splatbus_client.cuda.driver import api, call

        self.stream, self.size = call(api.cuStreamCreate, 1), size
        self.source = Buffer((size // 4,))
        self.target = Buffer((size // 4,)).pointer if target is None else target

    def __call__(self) -> None:
        from splatbus_client.cuda.driver import api, call

        call(api.cuMemcpyDtoDAsync, self.target, self.source.pointer, self.size, self.stream)
        call(api.cuStreamSynchronize, self.stream)


def shared_buffer(size: int) -> tuple[int, Callable[[], bytes]]:
    """CUDA's memory as a buffer of OpenGL: its address, and what OpenGL reads there at last."""
    from splatbus_client.cuda.driver import api, call

    place = api.CUmemLocation()
    place.type, place.id = api.CUmemLocationType.CU_MEM_LOCATION_TYPE_DEVICE, 0
    wanted = api.CUmemAllocationProp()
    wanted.type = api.CUmemAllocationType.CU_MEM_ALLOCATION_TYPE_PINNED
    wanted.location = place
    kind = api.CUmemAllocationHandleType.CU_MEM_HANDLE_TYPE_POSIX_FILE_DESCRIPTOR
    wanted.requestedHandleTypes = kind
    least = call(
        api.cuMemGetAllocationGranularity,
        wanted,
        api.CUmemAllocationGranularity_flags.CU_MEM_ALLOC_GRANULARITY_RECOMMENDED,
    )
    size = -(-size // least) * least
    handle = call(api.cuMemCreate, size, wanted, 0)
    pointer = int(call(api.cuMemAddressReserve, size, 0, 0, 0))
    call(api.cuMemMap, pointer, size, 0, handle, 0)
    access = api.CUmemAccessDesc()
    access.location = place
    access.flags = api.CUmemAccess_flags.CU_MEM_ACCESS_FLAGS_PROT_READWRITE
    call(api.cuMemSetAccess, pointer, size, [access], 1)
    descriptor = int(call(api.cuMemExportToShareableHandle, handle, kind, 0))

    memory, buffer = ctypes.c_uint(), ctypes.c_uint()
    gl("glCreateMemoryObjectsEXT", 1, ctypes.byref(memory))
    gl("glMemoryObjectParameterivEXT", memory, _DEDICATED, ctypes.byref(ctypes.c_int(1)))
    gl("glImportMemoryFdEXT", memory, ctypes.c_uint64(size), _OPAQUE_FD, descriptor)
    gl("glCreateBuffers", 1, ctypes.byref(buffer))
    gl("glNamedBufferStorageMemEXT", buffer, ctypes.c_ssize_t(size), memory, ctypes.c_uint64(0))
    error = gl("glGetError")
    if error:
        raise RuntimeError(f"OpenGL refuses CUDA's memory: error {error:#x}")

    def read() -> bytes:
        data = ctypes.create_string_buffer(4096)
        gl("glGetNamedBufferSubData", buffer, ctypes.c_ssize_t(0), ctypes.c_ssize_t(4096), data)
        return data.raw

    return pointer, read


def gl(name: str, *arguments: Any) -> int:
    """Call a function of OpenGL that moderngl does not have."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    address = egl.eglGetProcAddress(name.encode())
    if not address:
        raise RuntimeError(f"this OpenGL has no {name}")
    return int(ctypes.CFUNCTYPE(ctypes.c_uint)(address)(*arguments))


def bring(picture: Any, lease: Any, device: Any) -> None:
    """Until the textures hold it."""
    from splatbus_client.cuda.driver import api, call

    picture.take(lease)
    with device.current():
        call(api.cuCtxSynchronize)


def milliseconds(does: Callable[[], object]) -> float:
    began = time.perf_counter()
    does()
    return 1e3 * (time.perf_counter() - began)


def brought(context: Any, where: Any, size: tuple[int, int], rounds: int) -> list[dict[str, Any]]:
    """How long an image takes to be in textures, for colour alone and with depth."""
    from splatbus_client.cuda.driver import api, call, numbered
    from splatbus_client.session import Session
    from splatbus_viewer.view import orbit
    from splatbus_viewer.window.drawing.picture import Picture
    from splatbus_wire.poses import IDENTITY

    width, height = size
    device = numbered(0)
    rows = []
    for name, channels in PLANES.items():
        shapes = {each: (height, width, 4)[: 3 if each == "color" else 2] for each in channels}
        total = sum(4 * width * height * (4 if each == "color" else 1) for each in channels)
        picture = Picture(context)
        with device.current():
            bare, copy = Bare(context, shapes), Copy(total)
            shared: Copy | None = None
            try:
                pointer, read = shared_buffer(total)
                call(api.cuMemsetD8, pointer, 0x5A, total)
                call(api.cuCtxSynchronize)
                assert read() == b"\x5a" * 4096, "OpenGL does not see what CUDA wrote"
                shared = Copy(total, pointer)
            except Exception as problem:
                print(f"memory object: {problem}")
        ways: dict[str, Callable[[], object]] = {"interop": bare, "copy": copy}
        if shared is not None:
            ways["memory object"] = shared
        took: dict[str, list[float]] = {"window": [], **{each: [] for each in ways}}
        with Session(where, channels) as session:
            for number in range(rounds + 20):
                for each in took:
                    session.send_camera(orbit(IDENTITY, len(took[each]) / 60 + len(each)))
                    lease = session.next_frame(30.0)
                    if each == "window":
                        ms = milliseconds(partial(bring, picture, lease, device))
                        lease.release()
                    else:
                        lease.release()
                        with device.current():
                            ms = milliseconds(ways[each])
                    if number >= 20:
                        took[each].append(ms)
        medians = {each: statistics.median(ms) for each, ms in took.items() if ms}
        rows.append({"planes": name, "bytes": total, **medians})
        rows[-1]["part"] = medians["window"] / medians["interop"]
        print(rows[-1], flush=True)
    return rows


def poses(context: Any, where: Any, size: tuple[int, int]) -> dict[str, float]:
    """From a pose to its picture, milliseconds."""
    from splatbus_client.loop import clock
    from splatbus_client.session import Session
    from splatbus_viewer.latency import Latencies, percentiles
    from splatbus_viewer.view import orbit
    from splatbus_viewer.window.choices import assumed_camera
    from splatbus_viewer.window.drawing.ground import Ground
    from splatbus_viewer.window.drawing.picture import Picture
    from splatbus_wire.poses import IDENTITY

    picture, waits, sent = Picture(context), Latencies(), 0
    target = context.framebuffer([context.texture(size, 4)])
    camera = assumed_camera(IDENTITY, size)
    with Session(where, ("color",)) as session:
        while len(waits.seconds) < POSES:
            if sent == len(waits.seconds):
                sent += 1
                waits.asked_for(str(sent), clock())
                session.send_camera(orbit(IDENTITY, sent / 60), tag=str(sent))
            with session.next_frame(30.0) as lease:
                picture.take(lease)
            picture.draw(target, (0, 0, *size), "color", camera, Ground(None), (0.0, 1.0))
            context.finish()
            taken = picture.taken
            assert taken
            assert taken.camera
            waits.shown(taken.camera, clock())
    middle, late = percentiles(waits.seconds)
    return {"p50": 1e3 * middle, "p99": 1e3 * late}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks cuda_window")
    parser.add_argument("--rounds", type=int, default=300)
    parser.add_argument("--size", default="1920x1080")
    given = parser.parse_args()
    require_gpu("moderngl")
    import moderngl
    from splatbus_wire.settings import Settings

    width, height = map(int, given.size.split("x"))
    context = moderngl.create_context(standalone=True, backend="egl")
    renderer = context.info["GL_RENDERER"]
    print(renderer, flush=True)
    assert "NVIDIA" in renderer, f"OpenGL draws on {renderer}: {os.environ}"
    with serving("cuda", (width, height), "asked") as ports:
        where = Settings("127.0.0.1", *ports, None)
        rows = brought(context, where, (width, height), given.rounds)
        waits = poses(context, where, (width, height))
    print(waits)
    write("cuda_window", {"goal": GOAL, "rows": rows, "pose to picture, ms": waits})


if __name__ == "__main__":
    main()
