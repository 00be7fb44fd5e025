"""Mutants that compute the view from a pose as programs in the field do."""

from dataclasses import replace

import numpy as np
from splatbus_renderer import scene

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer
from tests.zoo.faults.surgery import adding_up_digits
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.cnv.servers import cameras, depths


@mutant(
    "ACC-2",
    check="check_rotations_are_those_of_the_quaternion",
    code="beyond-its-budget",
    at=renderer.ROWS_OF_ROTATION,
    in_device_memory=True,
)
def server_takes_quaternions_for_unit_ones(original, q):
    """Turns a quaternion into a matrix as if its norm were 1."""
    x, y, z, w = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


@mutant("ACC-2", check="check_rotations_are_those_of_the_quaternion", code="beyond-its-budget")
def server_rounds_quaternions_to_four_digits(patch):
    """Keeps four digits of each number of a rotation."""
    renderer.ROWS_OF_ROTATION.wrap(
        patch, lambda original, q: original(tuple(round(part, 4) for part in q))
    )


@mutant(
    "ACC-3", check="check_rotations_do_not_shear", code="beyond-its-budget", in_device_memory=True
)
def server_shears_its_views(patch):
    """Stores the rotation of a camera in half precision."""

    def half(camera):
        rows = np.array(camera.rotation).astype(np.float16).astype(float)
        return replace(camera, rotation=tuple(map(tuple, rows.tolist())))

    cameras(patch, half)


@mutant(
    "ACC-4", check="check_translations_are_exact", code="beyond-its-budget", in_device_memory=True
)
def server_counts_in_centimetres(patch):
    """Keeps where the camera is as whole hundredths of a unit."""
    cameras(
        patch,
        lambda camera: replace(
            camera, position=tuple(round(100 * number) / 100 for number in camera.position)
        ),
    )


@mutant(
    "ACC-5",
    check="check_the_camera_is_where_it_was_put",
    code="beyond-its-budget",
    in_device_memory=True,
)
def server_recovers_the_centre_by_another_rotation(patch):
    """Finds the camera's centre from the view's translation by a rotation of five digits."""

    def recovered(camera):
        exact = np.array(camera.rotation)
        centre = exact.round(5) @ (exact.T @ np.array(camera.position))
        return replace(camera, position=tuple(centre.tolist()))

    cameras(patch, recovered)


@mutant(
    "ACC-6",
    check="check_single_precision_is_rounded_once",
    code="missing-pixels",
    in_device_memory=True,
)
def server_multiplies_in_tf32(patch):
    """Multiplies matrices with 11 bits of each number, as tensor cores do unless told otherwise."""

    def tf32(values):
        bits = (np.asarray(values, np.float32).view(np.uint32) + 0x1000) & 0xFFFFE000
        return bits.view(np.float32).astype(float)

    def chained(camera):
        rotation = tf32(camera.rotation)
        moved = tf32(rotation.T @ tf32(camera.position))
        centre = np.array(camera.rotation) @ moved
        return replace(camera, position=tuple(centre.tolist()))

    cameras(patch, chained)


@mutant("ACC-12", check="check_what_is_farther_has_no_smaller_depth", code="depths-out-of-order")
def server_cuts_inverse_depth(patch):
    """Stores 5 where the inverse depth is below a cut, as deployed servers store 100."""
    depths(patch, lambda depth, camera: np.where(depth > 20.0, 5.0, depth))


@mutant(
    "ACC-13",
    check="check_every_pixel_is_what_single_precision_can_do",
    code="beyond-its-budget",
    at=Seam(scene, "subtract"),
)
def server_subtracts_in_single_precision(original, a, b):
    """Rounds positions to single precision before it subtracts them."""
    single = np.subtract(np.array(a, np.float32), np.array(b, np.float32))
    return tuple(single.astype(float).tolist())


@mutant(
    "ACC-13",
    check="check_every_pixel_is_what_single_precision_can_do",
    code="beyond-its-budget",
    at=renderer.RENDERS_IMAGE,
)
def server_has_a_dead_pixel(original, *arguments):
    """Leaves the pixel in the middle black."""
    image = original(*arguments)
    height, width, _ = image.color.shape
    image.color[height // 2, width // 2, :3] = 0.0
    return image


@mutant("ACC-14", check="check_numbers_are_read_to_the_last_bit", code="misrounded")
def server_adds_up_digits(patch):
    """Reads a number digit by digit, in double precision."""
    adding_up_digits(patch)
