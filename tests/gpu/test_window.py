"""The window's drawing of images that lie on a GPU, beside the same images from the host."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.gpu import require_gpu

require_gpu()
pytest.importorskip("moderngl", reason="the extra [window] is not installed")

import moderngl  # noqa: E402
from splatbus_client.session import Session  # noqa: E402
from splatbus_viewer.window import MODES  # noqa: E402
from splatbus_viewer.window.choices import assumed_camera  # noqa: E402
from splatbus_viewer.window.drawing.ground import Ground  # noqa: E402
from splatbus_viewer.window.drawing.picture import Picture  # noqa: E402
from splatbus_wire.poses import IDENTITY  # noqa: E402
from splatbus_wire.settings import Settings  # noqa: E402

from benchmarks.cuda_gl import serving  # noqa: E402

SIZE = 200, 120


@pytest.fixture(scope="module")
def context() -> Any:
    made = moderngl.create_context(standalone=True, backend="egl")
    assert "NVIDIA" in made.info["GL_RENDERER"]
    return made


def drawn(context: Any, kind: str, channels: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Each mode's picture of an image of noise, from memory of a GPU or of the host."""
    picture = Picture(context)
    with (
        serving(kind, SIZE, "always") as ports,
        Session(Settings("127.0.0.1", *ports, None), channels) as session,
    ):
        for _ in range(3):  # textures are written over
            with session.next_frame(60.0) as lease:
                if kind == "cuda":
                    assert lease.color_on_device
                picture.take(lease)
    assert picture.taken is not None
    assert picture.taken.copied == SIZE[0] * SIZE[1] * (20 if "depth" in channels else 16)
    target = context.framebuffer([context.texture(SIZE, 4, dtype="f4")])
    found = {}
    for mode in MODES:
        if mode == "color" or "depth" in channels:
            camera = assumed_camera(IDENTITY, SIZE)
            picture.draw(target, (0, 0, *SIZE), mode, camera, Ground(1.0), (3.0, 7.0))
            found[mode] = np.frombuffer(target.read(components=3, dtype="f4"), np.float32)
    return found


@pytest.mark.parametrize("channels", [("color",), ("color", "depth")])
def test_what_is_drawn_is_the_same_from_a_gpu(context: Any, channels: tuple[str, ...]) -> None:
    gpu, host = (drawn(context, kind, channels) for kind in ("cuda", "host"))
    assert list(gpu) == list(host) == list(MODES if "depth" in channels else ("color",))
    for mode, picture in gpu.items():
        assert picture.std() > 0.05  # it shows something
        assert (picture == host[mode]).all(), mode
