"""Allowed variations beside an adapter: engines and clients that say poses in their own way."""

from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any

from splatbus_client.steering import Steering
from splatbus_viewer.adapter import Adapter
from splatbus_wire.conventions import Engine
from splatbus_wire.messages import CameraPose, Intrinsics, ObjectPose, encode
from splatbus_wire.poses import IDENTITY, Pose
from splatbus_wire.superseding import subject

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.mutant import variation

DIGITS = 60


@variation(warns=("CTL-6",), axes="blender")
def says_its_last_camera_again(patch):
    """Says the camera that it said last once more before the first new one on a connection."""
    begun: list[CameraPose] = []

    def begin(original, self):
        former = list(self.newest.values())
        self.newest.clear()
        machine = original(self)
        self.newest.update({subject(message): message for message in former})
        begun[:] = [message for message in former if isinstance(message, CameraPose)]
        return machine

    def tell(original, self, message):
        if isinstance(message, CameraPose) and begun and self.machine is not None:
            self.machine.unsent += encode(begun.pop()._replace(timestamp=message.timestamp))
        original(self, message)

    client.BEGINS_TO_STEER.wrap(patch, begin)
    Seam(Steering, "tell").wrap(patch, tell)


@variation(axes="blender")
def steers_through_a_lens_of_its_own(patch):
    """Says where it looks from, and through which lens, as soon as it may."""
    first = CameraPose(IDENTITY, intrinsics=Intrinsics(300.0, 310.0, 30.0, 25.0, 64, 48, 0.1, 50.0))

    def begin(original, self):
        self.newest.setdefault(subject(first), first)
        return original(self)

    client.BEGINS_TO_STEER.wrap(patch, begin)


@variation(axes="blender", at=client.CUTS_TO_WHAT_WAS_AGREED)
def moves_the_splats_as_an_object(original, message, version, capabilities):
    """Moves the splats as the object `"default"`, where the server knows objects."""
    if isinstance(message, ObjectPose) and "objects" in capabilities:
        return message
    return original(message, version, capabilities)


@variation(axes="blender")
def converts_by_matrices_with_scale(patch):
    """Converts rotations through matrices, in which a norm other than 1 is a scale."""

    def to_wire(self, pose):
        matrix = self.matrix_to_wire(_matrix(*map(Fraction, pose.rotation)))  # type: ignore[arg-type]
        return Pose(self.position_to_wire(pose.position), _quaternion(matrix))

    Seam(Engine, "to_wire").replace(patch, to_wire)


@variation(axes="blender")
def asks_for_the_first_camera_ahead(patch):
    """Asks for the first camera before somebody wants it, and lets the next who does have that."""
    first = {"camera": 0}
    ahead: list[Any] = []

    def begin(original, self):
        ahead.clear()
        return original(self)

    def ask(original, self, requests):
        others = iter(original(self, [it for it in requests if it != first])["replies"])
        (camera,) = ahead or original(self, [first])["replies"]
        ahead[:] = original(self, [first])["replies"]
        return {"replies": [camera if it == first else next(others) for it in requests]}

    client.BEGINS_TO_STEER.wrap(patch, begin)
    Seam(Adapter, "ask").wrap(patch, ask)


def _matrix(x, y, z, w):
    """Of the scale that is the square of the norm."""
    a, b, c = (w * w + n * n - (x * x + y * y + z * z - n * n) for n in (x, y, z))
    d, e, f = 2 * y * z, 2 * x * z, 2 * x * y
    g, h, i = 2 * x * w, 2 * y * w, 2 * z * w
    return a, f - i, e + h, f + i, b, d - g, e - h, d + g, c


def _quaternion(matrix):
    """Of a matrix that is taken for one without scale."""
    with localcontext() as context:
        context.prec = DIGITS
        a, b, c, d, e, f, g, h, i = (Decimal(n.numerator) / n.denominator for n in matrix)
        squares = (1 + a - e - i, 1 - a + e - i, 1 - a - e + i, 1 + a + e + i)
        largest = max(range(4), key=lambda place: squares[place])
        rows = (
            (squares[0], b + d, c + g, h - f),
            (b + d, squares[1], f + h, c - g),
            (c + g, f + h, squares[2], d - b),
            (h - f, c - g, d - b, squares[3]),
        )
        twice = 2 * squares[largest].sqrt()
        x, y, z, w = (float(n / twice) for n in rows[largest])
    return x, y, z, w
