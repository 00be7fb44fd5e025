"""What the user has set: all that panels change, and nothing that is a server's."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from splatbus_wire.messages import FrameCamera, Intrinsics, Placement
from splatbus_wire.poses import IDENTITY, Pose

from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.drawing.ground import Ground

ASSUMED_FIELD = 60.0
"""Degrees from the upper to the lower edge, of a server that does not say."""
_TILTED = (math.sin(math.radians(-12)), 0.0, 0.0, math.cos(math.radians(-12)))
RING = "the ring"
"""What the viewer's own mesh is called among what can be moved."""


@dataclass
class Choices:
    """What is shown, and from where.

    Attributes:
        mode: one of `drawing.picture.MODES`.
        kind: how the camera moves, one of `cameras.KINDS`.
        eye: where it is; it follows the images' camera until it is moved.
        is_steering: whether it was moved, so that the server is told.
        field_of_view: degrees from the upper to the lower edge; None leaves it to the server.
        depths: nearest and farthest of the false colours.
        is_fitting: whether these follow what is seen.
        grid: height of the grid on the world's y axis, None for none.
        ring: where the viewer's own mesh is, None for none.
        objects: where objects were put, by name.
        held: what the gizmo holds: `RING`, an object's name or None.
        time: in the scene, seconds; None as long as nobody has set it.
        is_playing: whether it runs.
        shows_panels: or the image alone.
    """

    mode: str = "composite"
    kind: str = "orbit"
    eye: Eye = field(default_factory=lambda: Eye(IDENTITY))
    is_steering: bool = False
    field_of_view: float | None = None
    depths: tuple[float, float] = (0.0, 1.0)
    is_fitting: bool = True
    grid: float | None = None
    ring: Placement | None = None
    objects: dict[str, Placement] = field(default_factory=dict)
    held: str | None = None
    time: float | None = None
    is_playing: bool = False
    shows_panels: bool = True

    @property
    def channels(self) -> frozenset[str]:
        """What of the images is needed: depth only where it is shown, or hides something."""
        return frozenset(("color",) if self.mode == "color" else ("color", "depth"))

    @property
    def ground(self) -> Ground:
        """The viewer's own geometry."""
        return Ground(self.grid, self.ring)

    def moved_to(self, eye: Eye) -> None:
        """Take the eye from the server: from now on it is the user's."""
        self.eye, self.is_steering = eye, True

    def lens(self, width: int, height: int, near: float, far: float) -> Intrinsics | None:
        """The lens that is asked for, of an image of this size; None leaves it to the server."""
        if self.field_of_view is None:
            return None
        return pinhole(self.field_of_view, width, height, near, far)


def ring_before(eye: Eye) -> Placement:
    """Return a ring about the eye's pivot, 0.4 times as large as that is far, a little tilted."""
    return Placement(RING, Pose(eye.pivot, _TILTED), 0.4 * eye.distance)


def pinhole(degrees: float, width: int, height: int, near: float, far: float) -> Intrinsics:
    """Return the lens that sees so many degrees from the upper to the lower edge."""
    focal = height / 2 / math.tan(math.radians(degrees) / 2)
    return Intrinsics(focal, focal, width / 2, height / 2, width, height, near, far)


def assumed_camera(pose: Pose, size: tuple[int, int]) -> FrameCamera:
    """What an image of a server of 1.0, which does not say, is taken to be rendered with."""
    lens = pinhole(ASSUMED_FIELD, *size, 0.01, 1000.0)
    four = lens.fx, lens.fy, lens.cx, lens.cy
    return FrameCamera(pose, *four, *size, lens.near, lens.far)
