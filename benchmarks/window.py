"""What the window costs where images lie in memory of the host: processor time of an image.

On a virtual display, where OpenGL draws on the processor too, beside a server in a process of its
own that publishes one 1080p image on and on. `window`: all threads of the process, from one image
to the next. Its floor, `bare`: a loop on the same context that uploads as many bytes, from shared
memory too, through a buffer object, draws one quad and shows it. Both take turns; medians of all
rounds. `pose`: from a pose that is sent until its image is on the screen.

    python -m benchmarks window [--rounds 7] [--size 1920x1080]
"""

from __future__ import annotations

import argparse
import json
import math
import mmap
import platform
import shutil
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from splatbus_viewer.latency import percentiles
from splatbus_viewer.view import orbit
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.drawing.ground import shader
from splatbus_viewer.window.drawing.uploading import texture
from splatbus_wire.poses import IDENTITY
from splatbus_wire.settings import Settings

from benchmarks.cuda_gl import serving
from tests.window.stage import Staged, display, opened

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
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


class Bare:
    """A loop that uploads and draws, and does nothing else."""

    def __init__(self, staged: Staged, size: tuple[int, int], names: tuple[str, ...]) -> None:
        self.screen, self.context = staged.screen, staged.screen.context
        width, height = size
        draw = np.random.default_rng(0)
        self.parts = []
        for name in names:
            shape = height, width, 4 if name == "color" else 1
            shared = mmap.mmap(-1, 4 * math.prod(shape))  # images lie in shared memory, too
            image = np.frombuffer(shared, np.float32).reshape(shape)
            image[:] = draw.random(shape, np.float32)
            buffer = self.context.buffer(reserve=image.nbytes, dynamic=True)
            self.parts.append((texture(self.context, width, height, name), buffer, image))
        program = self.context.program(shader("picture.vert"), QUAD)
        self.quad = self.context.vertex_array(program, [])

    def __call__(self) -> None:
        """One image."""
        for made, buffer, image in self.parts:
            buffer.orphan()
            buffer.write(image)
            made.write(buffer)
        self.parts[0][0].use(0)
        self.context.screen.use()
        self.context.viewport = 0, 0, *self.parts[0][0].size
        self.quad.render(moderngl.TRIANGLES, vertices=3)
        self.screen.show()
        self.context.finish()


def processor(does: Callable[[], object]) -> float:
    """Milliseconds of all threads."""
    began = time.process_time()
    does()
    return 1e3 * (time.process_time() - began) / IMAGES


def costs(size: tuple[int, int], rounds: int) -> list[dict[str, Any]]:
    """What an image takes, of each kind."""
    rows = []
    for kind, chosen in KINDS.items():
        names = ("color",) if chosen["mode"] == "color" else ("color", "depth")
        with host(size, "always") as where, opened(where, size, **chosen) as staged:
            images = staged.window.conversation.images
            staged.rests()
            bare = Bare(staged, staged.window.picture.size, names)

            def window(staged: Staged = staged, images: Any = images) -> None:
                wanted = images.count + IMAGES
                staged.until(lambda: images.count >= wanted)

            def floor(bare: Bare = bare) -> None:
                for _ in range(IMAGES):
                    bare()

            took: dict[str, list[float]] = {"window": [], "bare": []}
            for number in range(rounds + 1):
                found = {"window": processor(window), "bare": processor(floor)}
                if number:
                    for name, ms in found.items():
                        took[name].append(ms)
            medians = {name: statistics.median(ms) for name, ms in took.items()}
            rows.append({"shown": kind, **medians, "part": medians["window"] / medians["bare"]})
            print(rows[-1], flush=True)
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
    middle, late = percentiles(waits.tolist())
    return {"p50": middle, "p99": late, "images": len(waits)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks window")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--size", default="1920x1080")
    given = parser.parse_args()
    if not shutil.which("Xvfb"):
        print("not run: Xvfb is not installed (Debian: xvfb libgl1-mesa-dri)")
        return
    width, height = map(int, given.size.split("x"))
    with display():
        rows = costs((width, height), given.rounds)
        waits = poses((width, height))
    print(waits)
    command = " ".join(["python -m benchmarks window", *sys.argv[1:]])
    system = f"{platform.system()} {platform.machine()}"
    report = {"command": command, "python": platform.python_version(), "system": system}
    report |= {"goal": GOAL, "rows": rows, "pose to picture, ms": waits}
    (RESULTS / "window.json").write_text(json.dumps(report, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
