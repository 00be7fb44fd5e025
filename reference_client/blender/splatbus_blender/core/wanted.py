"""What Blender shows, what of it is said to the server, and whether an image shows it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from splatbus_client.lease import placement
from splatbus_client.reading import ImagesOpen
from splatbus_wire.message_types import FrameCamera, Intrinsics, Placement
from splatbus_wire.messages import DEFAULT_OBJECT
from splatbus_wire.poses import Pose

from . import lens, poses
from .poses import Placed

Able = Collection[str]
_NEAR = 1e-5
"""What a server that computes in single precision may make of a number, relative to its size."""


class Wanted(NamedTuple):
    """What Blender shows, in its own axes and units.

    Attributes:
        camera: where it is seen from; None if from nowhere that a server can see from.
        lens: of the view; None likewise.
        objects: those that are moved, by their names in the splats' scene.
        seconds: the time in it; None to say none.
        size: of the view in pixels; None to take images as they come.
        depth: whether the depth of images is looked at, too.
    """

    camera: Placed | None = None
    lens: Intrinsics | None = None
    objects: Mapping[str, Placed] = {}
    seconds: float | None = None
    size: tuple[int, int] | None = None
    depth: bool = True

    @property
    def channels(self) -> tuple[str, ...]:
        """What is read of the server's images."""
        return ("color", "depth") if self.depth else ("color",)


class Said(NamedTuple):
    """What a server is told of it, in the axes of the wire and units of the splats' scene.

    Attributes:
        camera: its pose.
        lens: in pixels of the server's images; None while their size is not known.
        objects: pose and scale of each.
        seconds: the time in the scene.
        problems: what cannot be told, in words.
    """

    camera: Pose | None = None
    lens: Intrinsics | None = None
    objects: Mapping[str, tuple[Pose, float]] = {}
    seconds: float | None = None
    problems: tuple[str, ...] = ()


def said(wanted: Wanted, images: ImagesOpen | None, *, last: bool = True) -> Said:
    """Return what is to be told.

    Args:
        wanted: what Blender shows.
        images: those of the server; None while there are none.
        last: whether they keep their size, as far as is known: only a lens of their shape is
            taken [CAM-6].
    """
    unit = scene_unit(None if images is None else images.semantics.unit_metres)
    camera = None if wanted.camera is None else poses.camera_pose(wanted.camera, unit)
    through = None
    if wanted.lens is not None and images is not None and last:
        through = lens.for_images(wanted.lens, images.width, images.height, unit)
    objects, problems = {}, []
    for name, placed in wanted.objects.items():
        try:
            objects[name] = poses.object_pose(placed, unit)
        except ValueError as wrong:
            problems.append(f"the object {name!r} cannot be moved: {wrong}")
    return Said(camera, through, objects, wanted.seconds, tuple(problems))


def scene_unit(metres: float | None) -> float:
    """Return Blender's units, which are metres, to one of the splats' scene; 1 if it is unknown."""
    return 1.0 if metres is None else metres


def shows(camera: FrameCamera, objects: Sequence[Placement], said: Said, able: Able) -> bool:
    """Whether an image has camera and objects where they were said to be.

    Args:
        camera: what it was rendered with.
        objects: where they were in it, as far as they were moved.
        said: what it may show.
        able: the server's capabilities on the message channel.
    """
    return _seen_from(camera, said, able) and _moved(objects, said, able)


def _seen_from(camera: FrameCamera, said: Said, able: Able) -> bool:
    there = said.camera is None or _same(camera.pose, said.camera)
    if "intrinsics" not in able or said.lens is None:
        return there
    return there and all(map(_near, _numbers(camera), _numbers(said.lens)))


def _numbers(lens: FrameCamera | Intrinsics) -> tuple[float, ...]:
    return lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height, lens.near, lens.far


def _moved(objects: Sequence[Placement], said: Said, able: Able) -> bool:
    for name, (pose, scale) in said.objects.items():
        if "objects" not in able and (name, scale) != (DEFAULT_OBJECT, 1.0):
            continue
        at = placement(objects, name)
        if not (_same(at.pose, pose) and _near(at.scale, scale)):
            return False
    return True


def _same(one: Pose, other: Pose) -> bool:
    q, r = one.rotation, other.rotation
    turned = abs(sum(a * b for a, b in zip(q, r)))
    return all(map(_near, one.position, other.position)) and abs(turned - 1) <= _NEAR


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= _NEAR * max(1.0, abs(a), abs(b))
