"""Mutants that take what a `frame` tells beside its pixels for something else."""

import numpy as np
from splatbus_wire.messages import Frame

from tests.zoo.faults.seams import client
from tests.zoo.mutant import mutant

CAMERAS = "check_understands_the_cameras_of_frames"
OBJECTS = "check_understands_the_objects_of_frames"


def takes_frames(patch, taken):
    """Read each frame, and make something else of it."""

    def read(original, *arguments, **named):
        message = original(*arguments, **named)
        return taken(message) if isinstance(message, Frame) and message.camera else message

    client.READS_ON_IPC.wrap(patch, read)


def w_first(pose):
    """The pose, its quaternion taken for one whose w comes first."""
    w, x, y, z = pose.rotation
    return pose._replace(rotation=(x, y, z, w))


@mutant("IMG-26", check=CAMERAS, code="another-pose", axes="unity")
def takes_the_cameras_of_frames_with_w_first(patch):
    """Takes the first number of the rotation of a frame's camera for w."""

    def taken(frame):
        camera = frame.camera
        return frame._replace(camera=camera and camera._replace(pose=w_first(camera.pose)))

    takes_frames(patch, taken)


@mutant("IMG-26", check=OBJECTS, code="another-pose", axes="unity")
def takes_the_objects_of_frames_with_w_first(patch):
    """The same of objects."""

    def taken(frame):
        objects = (it._replace(pose=w_first(it.pose)) for it in frame.objects)
        return frame._replace(objects=tuple(objects))

    takes_frames(patch, taken)


@mutant("IMG-26", check=OBJECTS, code="other-objects", axes="opencv")
def takes_one_object_of_a_frame(patch):
    """Knows of one object alone, the first that a frame lists."""
    takes_frames(patch, lambda frame: frame._replace(objects=frame.objects[:1]))


@mutant("ACC-14", check="check_takes_the_numbers_of_frames", code="another-number", axes="opencv")
def takes_the_lens_in_single_precision(patch):
    """Holds focal lengths in single precision, and says that it has double."""

    def taken(frame):
        camera = frame.camera
        rounded = camera and camera._replace(fx=float(np.float32(camera.fx)))
        return frame._replace(camera=rounded)

    takes_frames(patch, taken)
