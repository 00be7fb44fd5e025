"""Mutants that break CAM: what they make of intrinsics."""

from dataclasses import replace
from typing import Any

from splatbus_server.connection import Refusal
from splatbus_wire import from_client
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import CameraPose

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.cnv.servers import cameras

SEEN, SHAPE = "check_images_are_seen_through_the_lens", "check_refuses_lenses_of_another_shape"
KEEPS, TELLS = "check_keeps_the_lens_in_force", "check_tells_the_lens_of_its_cameras"


@mutant("CAM-4", code="out-of-range", through="CAM-8")
def server_tells_cameras_without_a_focal_length(patch):
    """Tells cameras whose focal length is 0."""
    lens_told(patch, lambda lens: lens | {"fx": 0.0})


def lens_told(patch, change):
    """Change the intrinsics in replies to `get_camera_pose`."""

    def told(message):
        lens = message.get("intrinsics")
        return message if lens is None else message | {"intrinsics": change(lens)}

    messages(patch, told)


@mutant("CAM-5", check=SEEN, code="other-intrinsics")
def server_takes_lenses_as_they_are(patch):
    """Does not scale intrinsics to the size of its images."""
    server.SCALES_LENS.replace(patch, lambda lens, width, height: lens)


@mutant("CAM-5", check=SEEN, code="other-intrinsics", at=server.SCALES_LENS)
def server_scales_by_the_width_alone(original, lens, width, height):
    """Scales both axes by the width, as if a rounded size had the very shape of its images."""
    return original(lens, width, height)._replace(fy=lens.fy * width / lens.width)


@mutant("CAM-5", check="check_lenses_are_scaled_to_another_size", code="other-intrinsics")
def server_scales_lenses_to_its_first_size(patch):
    """Scales intrinsics to the size that images had at first, whatever they have now."""
    first: list[int] = []

    def to_first(original, lens, *size):
        first[:] = first or size
        return original(lens, *first)

    server.SCALES_LENS.wrap(patch, to_first)


@mutant("CAM-5", check=SEEN, code="other-pixels")
def server_renders_with_its_own_lens(patch):
    """Names the intrinsics that it was sent, and renders with its own."""
    own: list[Any] = []

    def former(camera):
        own.append(camera)
        it = own[0]
        return replace(camera, fx=it.fx, fy=it.fy, cx=it.cx, cy=it.cy)

    cameras(patch, former)


@mutant("CAM-5", check=SEEN, code="other-pixels")
def server_has_clipping_planes_of_its_own(patch):
    """Names the clipping planes that it was sent, and renders with 0.01 and 100."""
    cameras(patch, lambda camera: replace(camera, near=0.01, far=100.0))


@mutant("CAM-5", check=SEEN, code="refused")
def server_wants_the_very_shape(patch):
    """Refuses intrinsics whose width and height are not exactly as those of its images."""
    server.JUDGES_SHAPE_OF_LENS.replace(
        patch, lambda lens, width, height: lens.width * height == lens.height * width
    )


@mutant("CAM-6", check=SHAPE, code="no-error")
def server_stretches_images(patch):
    """Takes intrinsics of any shape."""
    server.JUDGES_SHAPE_OF_LENS.replace(patch, lambda lens, width, height: True)


@mutant("CAM-6", check=SHAPE, code="applies", at=server.TAKES_POSE)
def server_applies_the_rest(original, self, connection, message):
    """Reports intrinsics of another shape, and applies the pose without them."""
    refusal = original(self, connection, message)
    if isinstance(refusal, Refusal) and refusal.pointer == "/intrinsics":
        original(self, connection, message._replace(intrinsics=None))
    return refusal


@mutant("CAM-6", check=SHAPE, code="another-error")
def server_points_into_the_lens(patch):
    """Points at the width of intrinsics of another shape."""

    def pointed(error):
        there = error.get("pointer") == "/intrinsics"
        return error | {"pointer": "/intrinsics/width"} if there else error

    messages(patch, of_type("error", pointed))


@mutant("CAM-7", check=KEEPS, code="other-intrinsics", at=server.OBEYS)
def server_forgets_the_lens(original, self, connection, message):
    """Goes back to its own intrinsics with a pose that has none."""
    has_control = original(self, connection, message)
    if has_control and isinstance(message, CameraPose) and message.intrinsics is None:
        self.poses = self.poses._replace(intrinsics=None)
    return has_control


@mutant("CAM-7", check=KEEPS, code="other-intrinsics")
def server_takes_the_lens_of_anyone(patch):
    """Takes the intrinsics of clients that have no control."""

    newest: list[Any] = [None]

    def move(original, self, connection, message):
        has_control = original(self, connection, message)
        if isinstance(message, CameraPose):
            newest[0] = message.intrinsics or newest[0]
        self.poses = self.poses._replace(intrinsics=newest[0])
        return has_control

    server.OBEYS.wrap(patch, move)


@mutant("CAM-7", check=KEEPS, code="other-intrinsics", at=server.TAKES_POSE)
def server_keeps_a_lens_that_it_refused(original, self, connection, message):
    """Reports intrinsics of another shape, keeps the pose, and looks through them all the same."""
    refusal = original(self, connection, message)
    if isinstance(refusal, Refusal) and refusal.pointer == "/intrinsics":
        control = self.control
        control.poses = control.poses._replace(intrinsics=message.intrinsics)
    return refusal


@mutant("CAM-7", check=KEEPS, code="other-intrinsics", at=server.OBEYS)
def server_has_the_lens_of_anyone_until_the_next_pose(original, self, connection, message):
    """Looks through the intrinsics of a client without control until the one in control poses."""
    has_control = original(self, connection, message)
    if not has_control and isinstance(message, CameraPose) and message.intrinsics is not None:
        self.poses = self.poses._replace(intrinsics=message.intrinsics)
    elif isinstance(message, CameraPose):
        own = self.sent[connection][CameraPose]
        self.poses = self.poses._replace(intrinsics=own.intrinsics)  # type: ignore[union-attr]
    return has_control


@mutant("CAM-8", check=TELLS, code="no-intrinsics")
def server_tells_poses_alone(patch):
    """Leaves intrinsics out of its replies."""
    messages(patch, lambda m: {name: it for name, it in m.items() if name != "intrinsics"})


@mutant("CAM-8", check=TELLS, code="wrong-size")
def server_tells_the_lens_of_larger_images(patch):
    """Tells intrinsics of images of twice the size."""
    lens_told(patch, lambda lens: lens | {n: 2 * lens[n] for n in ("width", "height")})


@mutant("CAM-8", check=TELLS, code="intrinsics-changed", at=server.ANSWERS_REQUEST)
def server_tells_the_lens_of_its_client(original, self, *arguments):
    """Tells of its cameras the intrinsics that a client asked for."""
    kept, asked = self.exchange.lens, self.control.poses.intrinsics
    self.exchange.lens = asked or kept
    told = original(self, *arguments)
    self.exchange.lens = kept
    return told


@mutant("CAM-9", check="check_keeps_the_former_camera", code="applies")
def server_leaves_bad_tags_out(patch):
    """Takes a pose whose tag is none as one without a tag."""
    read_without(patch, "tag")


@mutant("CAM-9", check="check_keeps_the_former_camera", code="applies")
def server_leaves_bad_lenses_out(patch):
    """Takes a pose whose intrinsics are none as one without them."""
    read_without(patch, "intrinsics")


def read_without(patch, member):
    """Read a camera pose without this member, if it cannot be read with it."""

    def less(message):
        return {name: value for name, value in message.items() if name != member}

    read_again(patch, Seam(from_client, "pose_of_camera"), less)


def read_again(patch, reader, repair):
    """Repair what cannot be read, instead of refusing it; `reader` reads such messages."""

    def read(original, message):
        try:
            return original(message)
        except ProtocolError:
            return original(message._replace(value=repair(message.value)))

    reader.wrap(patch, read)


@mutant(
    "CAM-10",
    check="check_uses_no_lens_that_was_not_granted",
    code="lens-in-force",
    at=server.ASKS_WHAT_WAS_AGREED,
)
def server_uses_a_lens_that_was_not_granted(original, self, capability):
    """Takes intrinsics from everybody, whatever was agreed upon."""
    return capability == "intrinsics" or bool(original(self, capability))
