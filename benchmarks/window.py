"""What the window costs where images lie in memory of the host: processor time of an image.

On a virtual display, where OpenGL draws on the processor too, beside a server in a process of its
own that publishes one 1080p image on and on. `window`: all threads of the process, from one image
to the next. Its floor, `bare`: a loop on the same context that uploads as many bytes, from shared
memory too, through a buffer object, draws one quad and shows it. Both take turns; medians of all
rounds. `pose`: from a pose that is sent until its image is on the screen.

    python -m benchmarks window [--rounds 7] [--size 1920x1080]
"""

from __future__ import annotations

import math
import mmap
import shutil
import statistics
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
from splatbus_viewer.view import orbit
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.drawing.ground import shader
from splatbus_viewer.window.drawing.uploading import texture
from splatbus_wire.poses import IDENTITY
from splatbus_wire.settings import Settings

from benchmarks import _shared
from benchmarks.cuda_gl import serving
from tests.window.stage import Staged, display, opened

GOAL = 1.2
"""Times the floor."""
IMAGES = 20
"""Of a round."""
POSES = 300
KINDS: dict[str, dict[str, Any]] = {
    "color": {"mode": "color", "shows_panels": False},
    "color, panels": {"mode": "color", "shows_panels": True},
    "composite": {"mode": "composite", "shows_panels": False},
}
QUAD = """
#version 330 core
uniform sampler2D image;
out vec4 shown;
void main() { shown = texelFetch(image, ivec2(gl_FragCoord.xy), 0); }
"""


@contextmanager
def host(size: tuple[int, int], when: str) -> Iterator[Settings]:
    """Where a server is whose images lie in memory of the host."""
    with serving("host", size, when) as ports:
        yield Settings("127.0.0.1", *ports, None)


def bare(staged: Staged, names: tuple[str, ...]) -> _shared.Work:
    """A loop that uploads and draws, and does nothing else."""
    screen, context = staged.screen, staged.screen.context
    width, height = staged.window.picture.size
    draw, parts = np.random.default_rng(0), []
    for name in names:
        shape = height, width, 4 if name == "color" else 1
        shared = mmap.mmap(-1, 4 * math.prod(shape))  # images lie in shared memory, too
        image = np.frombuffer(shared, np.float32).reshape(shape)
        image[:] = draw.random(shape, np.float32)
        buffer = context.buffer(reserve=image.nbytes, dynamic=True)
        parts.append((texture(context, width, height, name), buffer, image))
    program = context.program(shader("picture.vert"), QUAD)
    quad = context.vertex_array(program, [])

    def work() -> None:
        for _ in range(IMAGES):
            for made, buffer, image in parts:
                buffer.orphan()
                buffer.write(image)
                made.write(buffer)
            parts[0][0].use(0)
            context.screen.use()
            context.viewport = 0, 0, width, height
            quad.render(moderngl.TRIANGLES, vertices=3)
            screen.show()
            context.finish()

    return work


def costs(size: tuple[int, int], rounds: int) -> list[dict[str, Any]]:
    """What an image takes, of each kind."""
    rows = []
    for kind, chosen in KINDS.items():
        names = ("color",) if chosen["mode"] == "color" else ("color", "depth")
        with host(size, "always") as where, opened(where, size, **chosen) as staged:
            images = staged.window.conversation.images
            staged.rests()

            def window(staged: Staged = staged, images: Any = images) -> None:
                wanted = images.count + IMAGES
                staged.until(lambda: images.count >= wanted)

            (times,) = _shared.beside(bare(staged, names), [window], rounds)
            taken, least = (statistics.median(each) / IMAGES for each in times)
            row = {"shown": kind, "window": taken, "bare": least, "part": times.ratio()[1]}
            rows.append(_shared.told(row))
    return rows


def poses(size: tuple[int, int]) -> dict[str, float]:
    """From a pose to its picture, milliseconds."""
    chosen = {"mode": "color", "shows_panels": False}
    with host(size, "asked") as where, opened(where, size, **chosen) as staged:
        talk, window = staged.window.conversation, staged.window
        staged.rests()
        for number in range(POSES):
            window.choices.moved_to(Eye(orbit(IDENTITY, (number + 1) / 60)))
            window.turn()
            staged.until(lambda: talk.is_answered)
        _, waits = talk.images.latency.points(0.0)
    return _shared.percentiles(waits.tolist())


def main() -> None:
    given = _shared.options(__doc__, rounds=7, size="1920x1080")
    if not shutil.which("Xvfb"):
        print("not run: Xvfb is not installed (Debian: xvfb libgl1-mesa-dri)")
        return
    with display():
        rows = costs(given.size, given.rounds)
        waits = poses(given.size)
    print(waits)
    _shared.write("window", {"goal": GOAL, "rows": rows, "pose to picture": waits})


if __name__ == "__main__":
    main()
