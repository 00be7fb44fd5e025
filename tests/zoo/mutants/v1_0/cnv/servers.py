"""Mutants whose images show something else than their frames say, or than was asked for."""

import time
from dataclasses import replace
from typing import Any

import numpy as np
from splatbus_renderer import demo
from splatbus_renderer.scene import IDENTITY, ObjectPose, multiply, rotate, transpose
from splatbus_server import session
from splatbus_server.control import Poses
from splatbus_wire.messages import CameraPose, Placement
from splatbus_wire.poses import Pose

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.buf import stored

SOMEWHERE = Pose((0.4, -0.3, -0.6), (0.1, -0.2, 0.05, 0.9733961166965893))


def cameras(patch, change):
    """Render with another camera than the view asks for."""
    renderer.CAMERA_OF_VIEW.wrap(patch, lambda original, view: change(original(view)))


def rotations(patch, change):
    """Take the quaternion of the camera for another one."""

    def camera(original, view):
        matrix = demo.matrix_of(change(view.poses.camera.rotation))
        return replace(original(view), rotation=matrix)

    renderer.CAMERA_OF_VIEW.wrap(patch, camera)


def depths(patch, change):
    """Give out other depths than were rendered: `change` is given them and the camera."""

    def render(original, self, scene, camera, wanted=True):
        image = original(self, scene, camera, wanted)
        if image.depth is None:
            return image
        return image._replace(depth=change(image.depth, camera).astype(np.float32))

    renderer.RENDERS_IMAGE.wrap(patch, render)


def inverse(rotation, position):
    """The inverse of a pose, as a matrix and a place."""
    turned = transpose(rotation)
    x, y, z = rotate(turned, position)
    return turned, (-x, -y, -z)


# Rows and depth


@mutant("BUF-1", check="check_rows_are_bottom_up", code="rows-top-down", in_device_memory=True)
def server_stores_rows_top_down(patch):
    """Stores the top row of the image first."""
    for channel in ("color", "depth"):
        stored(patch, channel, lambda slot: np.copyto(slot, slot[::-1].copy()))


@mutant("BUF-1", check="check_rows_are_bottom_up", code="columns-from-the-right")
def server_stores_columns_from_the_right(patch):
    """Stores the right column of the image first."""
    for channel in ("color", "depth"):
        stored(patch, channel, lambda slot: np.copyto(slot, slot[:, ::-1].copy()))


@mutant("BUF-6", check="check_depth_is_planar", code="ray-distances")
def server_stores_distances_along_the_ray(patch):
    """Stores how far a surface is from the camera's centre."""

    def distances(depth, camera):
        x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
        y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
        return depth * np.sqrt(1.0 + x[None, :] ** 2 + y[:, None] ** 2)

    depths(patch, distances)


@mutant("BUF-6", check="check_depth_is_planar", code="depths-scaled")
def server_stores_depth_in_hundredths(patch):
    """Stores depth in centimetres, and poses are in metres."""
    depths(patch, lambda depth, camera: 100.0 * depth)


@mutant("BUF-6", check="check_depth_is_planar", code="inverse-depths", in_device_memory=True)
def server_stores_inverse_depth(patch):
    """Stores 1/z where there is a surface."""
    depths(patch, lambda depth, camera: np.where(np.isfinite(depth), 1.0 / depth, np.inf))


# Poses


@mutant(
    "CNV-1", check="check_poses_are_camera_to_world", code="world-to-camera", in_device_memory=True
)
def server_takes_poses_for_world_to_camera(patch):
    """Renders with the inverse of the pose that was sent."""

    def turned_round(camera):
        rotation, position = inverse(camera.rotation, camera.position)
        return replace(camera, rotation=rotation, position=position)

    cameras(patch, turned_round)


@mutant("CNV-1", check="check_poses_are_camera_to_world", code="axes-of-opengl")
def server_looks_along_minus_z(patch):
    """Takes the rotation for that of a camera with y up that looks backward."""
    back = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    cameras(patch, lambda camera: replace(camera, rotation=multiply(camera.rotation, back)))


@mutant("CNV-1", check="check_poses_are_camera_to_world", code="misnamed-pose")
def server_names_world_to_camera_poses(patch):
    """Renders rightly, but tells the view matrix in its frames."""

    def told(message):
        camera = message["camera"]
        _, position = inverse(demo.matrix_of(camera["rotation"]), camera["position"])
        x, y, z, w = camera["rotation"]
        named = camera | {"position": list(position), "rotation": [-x, -y, -z, w]}
        return message | {"camera": named}

    messages(patch, of_type("frame", told))


@mutant("CNV-1", check="check_poses_are_camera_to_world", code="misreported-pose")
def server_tells_cameras_as_world_to_camera(patch):
    """Has a camera of its own, and tells the inverse of its pose when asked."""
    renderer.SERVES.wrap(
        patch,
        lambda original, *size, **named: original(*size, cameras=[SOMEWHERE], **named),
    )

    def told(message):
        if "viewport_size" in message or "rotation" not in message:
            return message
        _, position = inverse(demo.matrix_of(message["rotation"]), message["position"])
        x, y, z, w = message["rotation"]
        return message | {"position": list(position), "rotation": [-x, -y, -z, w]}

    messages(patch, told)


@mutant("CNV-3", check="check_rotations_are_hamilton_with_w_last", code="rotation-read-w-first")
def server_reads_the_scalar_first(patch):
    """Takes the first number of a rotation for its scalar."""
    rotations(patch, lambda q: (q[1], q[2], q[3], q[0]))


@mutant(
    "CNV-3",
    check="check_rotations_are_hamilton_with_w_last",
    code="rotation-inverted",
    in_device_memory=True,
)
def server_reads_jpl_quaternions(patch):
    """Turns the camera the other way round."""
    rotations(patch, lambda q: (-q[0], -q[1], -q[2], q[3]))


@mutant("CNV-3", check="check_rotations_are_hamilton_with_w_last", code="misnamed-pose")
def server_names_the_scalar_first(patch):
    """Writes w, x, y, z in its frames."""

    def told(message):
        x, y, z, w = message["camera"]["rotation"]
        return message | {"camera": message["camera"] | {"rotation": [w, x, y, z]}}

    messages(patch, of_type("frame", told))


@mutant("CNV-3", check="check_rotations_are_hamilton_with_w_last", code="misreported-pose")
def server_tells_the_scalar_first(patch):
    """Writes w, x, y, z in its replies."""

    def told(message):
        if "rotation" not in message:
            return message
        x, y, z, w = message["rotation"]
        return message | {"rotation": [w, x, y, z]}

    messages(patch, told)


# Which pose, and when


@mutant("IMG-5", check="check_images_are_of_the_camera_that_is_named", code="former-camera")
def server_renders_the_first_camera_only(patch):
    """Names every camera that it is sent, and stays where it was."""
    still: list[Any] = []

    def first(camera):
        still.append(camera)
        return still[0]

    cameras(patch, first)


@mutant("IMG-5", check="check_every_pixel_is_of_the_camera", code="other-colours")
def server_has_pixel_centres_at_integers(patch):
    """Takes the corner of a pixel for its centre, and so draws everything half a pixel off."""
    cameras(patch, lambda it: replace(it, cx=it.cx + 0.5, cy=it.cy + 0.5))


@mutant("IMG-5", check="check_every_pixel_is_of_the_camera", code="other-colours")
def server_is_one_camera_late(patch):
    """Names the camera that it was sent, and renders with the one before it."""
    seen: list[Any] = []

    def former(camera):
        seen.append(camera)
        return seen[-2:][0]

    cameras(patch, former)


@mutant(
    "IMG-5",
    check="check_colour_and_depth_are_of_one_moment",
    code="other-pixels",
    at=server.LEASES_NEWEST,
)
def server_names_the_newest_camera(original, self, *arguments):
    """Names the camera that it has when it sends a frame, not the one that the image is of."""
    image = original(self, *arguments)
    if image is None:
        return None
    return replace_view(image, replace(image.view, poses=self.poses))


def replace_view(image, view):
    """An image that is said to be of another view."""
    return image._replace(view=view) if hasattr(image, "_replace") else replace(image, view=view)


@mutant("IMG-5", check="check_colour_and_depth_are_of_one_moment", code="other-pixels")
def server_stores_the_depth_before(patch):
    """Stores with each colour the depth of the image before."""
    seen: list[Any] = []

    def former(depth, camera):
        seen.append(depth.copy())
        return seen[-2:][0]

    depths(patch, former)


@mutant("POS-7", check="check_the_newest_camera_is_shown", code="another-pose")
def server_takes_the_first_of_many_poses(patch):
    """Of camera poses that come within 10 ms it takes the first."""
    last = [0.0]

    def move(original, self, connection, message):
        if isinstance(message, CameraPose):
            now, before = time.monotonic(), last[0]
            last[0] = now
            if now - before < 0.01:
                return True
        return original(self, connection, message)

    server.OBEYS.wrap(patch, move)


@mutant("POS-7", check="check_the_newest_scene_is_shown", code="scene-unmoved")
def server_leaves_the_scene_where_it_is(patch):
    """Renders the Gaussians where they always were."""
    renderer.POSE_IN_VIEW.replace(patch, lambda view, angle: ObjectPose())


@mutant("POS-7", check="check_the_newest_scene_is_shown", code="scene-not-turned")
def server_does_not_turn_the_scene(patch):
    """Takes the position of the Gaussians, and leaves out their rotation."""
    renderer.POSE_IN_VIEW.wrap(
        patch,
        lambda original, *arguments: replace(original(*arguments), rotation=IDENTITY),
    )


@mutant(
    "POS-7",
    check="check_the_newest_scene_is_shown",
    code="scene-moved-back",
    at=renderer.POSE_IN_VIEW,
)
def server_moves_the_scene_by_the_inverse(original, *arguments):
    """Takes the pose of the Gaussians for world-to-object."""
    asked = original(*arguments)
    rotation, position = inverse(asked.rotation, asked.position)
    return replace(asked, rotation=rotation, position=position)


@mutant("POS-13", check="check_the_scene_is_at_rest_at_first", code="not-at-rest")
def server_puts_the_scene_elsewhere_at_first(patch):
    """Begins with the Gaussians moved to the left, as its author likes them."""
    moved = Pose((-0.25, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    there = {"default": Placement("default", moved)}
    Seam(session, "Poses").replace(
        patch, lambda camera, objects: Poses(camera, {**objects, **there})
    )
