"""What Blender's objects say, as numbers for `poses`, `lens` and `timeline`.

Blender's types have no hints, so that its things are `Any` here. They need to be evaluated, be it
as originals that the view layer was updated with.
"""

from __future__ import annotations

from typing import Any

from splatbus_wire.rotations import Quaternion

from .core import poses, timeline
from .core.lens import Film, Optics
from .core.poses import Placed


def placed(thing: Any) -> Placed:
    """Return where an object is.

    Raises:
        ValueError: no pose can say it.
    """
    rows = [tuple(row) for row in thing.matrix_world]
    scale = tuple(thing.scale)
    if min(scale) > 0:
        own = Placed(tuple(thing.location), rotation(thing), scale)
        # A parent, a constraint or a delta transform makes them differ.
        if poses.agree(own, rows):
            return own
    return poses.from_matrix(rows)


def rotation(thing: Any) -> Quaternion:
    """Return an object's own rotation, in whichever way it is kept."""
    mode = thing.rotation_mode
    if mode == "QUATERNION":
        w, x, y, z = thing.rotation_quaternion
        return poses.unit_quaternion((x, y, z, w))
    if mode == "AXIS_ANGLE":
        angle, *axis = thing.rotation_axis_angle
        return poses.from_axis_angle(angle, (axis[0], axis[1], axis[2]))
    return poses.from_euler(tuple(thing.rotation_euler), mode)


def eye(region_data: Any) -> Placed:
    """Return where a viewport is seen from that does not look through a camera."""
    w, x, y, z = region_data.view_rotation
    centre = tuple(region_data.view_location)
    own = poses.orbiting(centre, (x, y, z, w), region_data.view_distance)
    # One that is locked to an object keeps another centre than it says.
    rows = [tuple(row) for row in region_data.view_matrix.inverted()]
    reach = max(region_data.view_distance, *map(abs, centre))
    return own if poses.agree(own, rows, reach) else poses.from_matrix(rows)


def optics(camera: Any) -> Optics:
    """Return the numbers of a camera's data.

    Raises:
        ValueError: it is not a perspective camera.
    """
    if camera.type != "PERSP":
        raise ValueError("splats are seen through a perspective lens only")
    return Optics(*(getattr(camera, name) for name in Optics._fields))


def film(render: Any) -> Film:
    """Return what a scene's render settings make images of."""
    part = render.resolution_percentage
    return Film(
        max(1, render.resolution_x * part // 100),
        max(1, render.resolution_y * part // 100),
        render.pixel_aspect_x,
        render.pixel_aspect_y,
    )


def seconds(scene: Any) -> float:
    """Return the time in the splats' scene that the current frame shows."""
    frame = scene.frame_current + scene.frame_subframe
    return timeline.seconds(frame, scene.frame_start, scene.render.fps, scene.render.fps_base)
