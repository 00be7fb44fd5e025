"""What the window does with an image of a GPU: from the frame to textures of OpenGL.

Without a display, in an OpenGL context of EGL, beside a server in a process of its own that
publishes one 1080p image whenever it is asked for another view. `window`: from the moment at which
a frame is there until its textures hold it. Its floor, `interop`: map, copy, unmap and wait for the
same bytes, from memory of our own. Each in turn comes after a
frame of its own, as the GPU changes from the server's work to ours then, which takes 0.3 ms;
medians. `pose`: from a pose that is sent until its image is drawn, over 1,000 poses.

    python -m benchmarks cuda_window [--rounds 300] [--size 1920x1080]
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks import _cuda, _shared
from benchmarks._cuda import Buffer, api, call
from benchmarks.cuda_gl import serving

GOAL = 1.1
"""Times the floor."""
POSES = 1000
PLANES = {"color": ("color",), "color and depth": ("color", "depth")}


def interop(context: Any, shapes: dict[str, tuple[int, ...]]) -> Callable[[], None]:
    """Graphics interoperability of the same bytes, and nothing else."""
    from splatbus_viewer.window.drawing.uploading import texture

    stream, parts = call(api.cuStreamCreate, 1), []
    for name, shape in shapes.items():
        made = texture(context, shape[1], shape[0], name)
        resource = call(api.cuGraphicsGLRegisterImage, made.glo, 0x0DE1, 2)
        parts.append((made, resource, Buffer(shape)))

    def work() -> None:
        for _, resource, buffer in parts:
            call(api.cuGraphicsMapResources, 1, resource, stream)
            copy = api.CUDA_MEMCPY2D()
            copy.srcMemoryType = api.CUmemorytype.CU_MEMORYTYPE_DEVICE
            copy.dstMemoryType = api.CUmemorytype.CU_MEMORYTYPE_ARRAY
            copy.srcDevice = buffer.pointer
            copy.srcPitch = copy.WidthInBytes = buffer.bytes // buffer.shape[0]
            copy.Height = buffer.shape[0]
            copy.dstArray = call(api.cuGraphicsSubResourceGetMappedArray, resource, 0, 0)
            call(api.cuMemcpy2DAsync, copy, stream)
            call(api.cuGraphicsUnmapResources, 1, resource, stream)
        call(api.cuStreamSynchronize, stream)

    return work


def bring(picture: Any, lease: Any, device: Any) -> None:
    """Until the textures hold it."""
    picture.take(lease)
    with device.current():
        call(api.cuCtxSynchronize)


def brought(context: Any, where: Any, size: tuple[int, int], rounds: int) -> list[dict[str, Any]]:
    """How long an image takes to be in textures, for colour alone and with depth."""
    from splatbus_client.cuda.driver import numbered
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
            bare = interop(context, shapes)
        took: dict[str, list[float]] = {each: [] for each in ("window", "interop")}
        with Session(where, channels) as session:
            for _ in range(rounds + 20):
                for each, times in took.items():
                    session.send_camera(orbit(IDENTITY, len(times) / 60 + len(each)))
                    with session.next_frame(30.0) as lease:
                        if each == "window":
                            times.append(_shared.wall_ms(partial(bring, picture, lease, device)))
                    if each != "window":
                        with device.current():
                            times.append(_shared.wall_ms(bare))
        medians = {each: statistics.median(times[20:]) for each, times in took.items()}
        row = {"planes": name, "bytes": total, **medians}
        rows.append(_shared.told(row | {"part": medians["window"] / medians["interop"]}))
    return rows


def poses(context: Any, where: Any, size: tuple[int, int]) -> dict[str, float]:
    """From a pose to its picture, milliseconds."""
    from splatbus_client.loop import clock
    from splatbus_client.session import Session
    from splatbus_viewer.latency import Latencies
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
    return _shared.percentiles([1e3 * wait for wait in waits.seconds])


def main() -> None:
    given = _shared.options(__doc__, rounds=300, size="1920x1080")
    _cuda.require_gpu("moderngl")
    import moderngl
    from splatbus_wire.settings import Settings

    context = moderngl.create_context(standalone=True, backend="egl")  # type: ignore[arg-type]
    assert "NVIDIA" in context.info["GL_RENDERER"], context.info
    with serving("cuda", given.size, "asked") as ports:
        where = Settings("127.0.0.1", *ports, None)
        rows = brought(context, where, given.size, given.rounds)
        waits = poses(context, where, given.size)
    print(waits)
    _cuda.write("cuda_window", {"goal": GOAL, "rows": rows, "pose to picture": waits})


if __name__ == "__main__":
    main()
