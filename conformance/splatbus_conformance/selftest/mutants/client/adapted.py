"""Mutants that only an adapter shows: what they convert, understand, read and show is wrong."""

import dataclasses
import time
from typing import Any

import numpy as np
from splatbus_client import adapter, display, mirror
from splatbus_client.host_memory import HostImages
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.lease import FrameLease
from splatbus_client.mirror import Copied, Mirror
from splatbus_client.reading import Reading
from splatbus_client.session import Session
from splatbus_client.steering import Steering
from splatbus_wire import conventions
from splatbus_wire.compositing import over_straight
from splatbus_wire.conventions import (
    BLENDER_CAMERA,
    BLENDER_OBJECT,
    ENGINES,
    OPENGL,
    UNREAL,
    Engine,
)
from splatbus_wire.messages import CameraPose
from splatbus_wire.poses import Pose, view_matrix

from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import mutant
from splatbus_conformance.selftest.surgery import Json, adding_up_digits, messages, of_type, wrap

CAMERAS = "check_camera_poses_are_camera_to_world"
DIGITS = "check_numbers_keep_their_digits"
OUT, IN = "check_axes_change_exactly_on_the_way_out", "check_axes_change_exactly_on_the_way_in"
SEMANTICS = "check_shows_images_by_their_semantics"

# Poses


@mutant("CNV-1", check=CAMERAS, reason="it is world-to-camera", axes="opencv")
def sends_world_to_camera(patch: Patch) -> None:
    """Sends the view matrix's translation and the inverse rotation."""

    def send(original: Any, self: Session, pose: Pose) -> None:
        view, (x, y, z, w) = view_matrix(pose), pose.rotation
        original(self, Pose((view[3], view[7], view[11]), (-x, -y, -z, w)))

    wrap(patch, Session, "send_camera", send)


@mutant("CNV-1", check="check_understands_cameras", reason="in the wire's axes", axes="unity")
def takes_replies_as_they_are(patch: Patch) -> None:
    """Puts the engine's camera where the reply says, without a change of axes."""
    patch.setattr(Engine, "from_wire", lambda self, pose: pose)


@mutant("CNV-1", check=CAMERAS, reason="the pose that was given before", axes="unity")
def sends_the_pose_before(patch: Patch) -> None:
    """Sends each time the pose that it was given the time before."""
    former: list[Pose] = []

    def send(original: Any, self: Session, pose: Pose) -> None:
        for before in former:
            original(self, before)
        former[:] = [pose]

    wrap(patch, Session, "send_camera", send)


@mutant(
    "CNV-1",
    check="check_says_its_camera_again_as_it_was",
    reason="was said again as",
    axes="blender",
)
def says_its_camera_again_in_other_axes(patch: Patch) -> None:
    """Says its last camera again, when it has come back, in the axes of its engine."""

    def begin(original: Any, self: Steering) -> Any:
        for key, message in self._newest.items():
            if isinstance(message, CameraPose):
                pose = BLENDER_CAMERA.from_wire(message.pose)
                self._newest[key] = message._replace(pose=pose)
        return original(self)

    wrap(patch, Steering, "begin", begin)


@mutant("CNV-1", check="check_understands_cameras", reason="in the other direction", axes="unreal")
def converts_replies_in_the_other_direction(patch: Patch) -> None:
    """Converts the camera of a reply as if it were the engine's own."""
    patch.setattr(Engine, "from_wire", Engine.to_wire)


@mutant(
    "CNV-2",
    check="check_object_poses_are_object_to_world",
    reason="by the row blender_camera",
    axes="blender",
)
def takes_objects_for_cameras(patch: Patch) -> None:
    """Converts the pose of the splats as if they looked along −z."""
    patch.setitem(ENGINES, "blender_object", BLENDER_CAMERA)


@mutant(
    "CNV-3",
    check="check_quaternions_are_hamilton_with_w_last",
    reason="members are in another order",
    axes="opencv",
)
def sends_w_under_the_name_of_x(patch: Patch) -> None:
    """Takes an engine's quaternion w, x, y, z for x, y, z, w."""

    def send(original: Any, self: Session, pose: Pose) -> None:
        x, y, z, w = pose.rotation
        original(self, pose._replace(rotation=(w, x, y, z)))

    wrap(patch, Session, "send_camera", send)


@mutant("CNV-4", check="check_unity_s_row", reason="by the row opengl", axes="unity")
def takes_unity_for_right_handed(patch: Patch) -> None:
    """Converts Unity's poses by the row of OpenGL."""
    patch.setitem(ENGINES, "unity", OPENGL)


@mutant("CNV-5", check="check_unreal_s_row", reason="in the engine's units", axes="unreal")
def sends_centimetres(patch: Patch) -> None:
    """Does not divide Unreal's positions by 100."""
    patch.setitem(ENGINES, "unreal", dataclasses.replace(UNREAL, scale=1.0))


@mutant("CNV-6", check="check_blender_s_rows", reason="by the row blender_object", axes="blender")
def takes_cameras_for_objects(patch: Patch) -> None:
    """Converts Blender's cameras, which look along −z, by the row of objects."""
    patch.setitem(ENGINES, "blender_camera", BLENDER_OBJECT)


@mutant(
    "CNV-7",
    check="check_opengl_s_row",
    reason="only its position was converted",
    axes="opengl",
)
def flips_only_positions(patch: Patch) -> None:
    """Flips y and z of positions, and sends rotations as they are."""
    only = dataclasses.replace(OPENGL, rotation_to_wire=lambda q: q)
    patch.setitem(ENGINES, "opengl", only)


def _spelled(patch: Patch, spell: Any, *parts: str) -> None:
    def change(pose: Json) -> Json:
        return pose | {
            part: {name: spell(number) for name, number in pose[part].items()} for part in parts
        }

    messages(patch, of_type("camera_pose", change))


@mutant("ACC-1", check=DIGITS, reason="position: worst", axes="opencv")
def sends_six_digits(patch: Patch) -> None:
    """Prints numbers with six significant digits, as printf's %g does."""
    _spelled(patch, lambda number: float(f"{number:.6g}"), "position", "rotation")


@mutant("ACC-1", check=DIGITS, reason="position: worst", axes="opencv")
def sends_sixteen_digits_of_positions(patch: Patch) -> None:
    """Prints positions with sixteen significant digits, one short of enough."""
    _spelled(patch, lambda number: float(f"{number:.16g}"), "position")


@mutant("ACC-1", check=DIGITS, reason="quaternion: worst", axes="unity")
def sends_single_precision(patch: Patch) -> None:
    """Has rotations in double precision, and prints them in single."""
    _spelled(patch, lambda number: float(np.float32(number)), "rotation")


@mutant(
    "ACC-14",
    check="check_numbers_are_read_to_the_last_bit",
    reason="position: worst",
    axes="opencv",
)
def adds_up_digits(patch: Patch) -> None:
    """Reads a number digit by digit, in double precision."""
    adding_up_digits(patch)


@mutant("ACC-7", check=OUT, reason="of 0.5 in", axes="unreal")
def multiplies_by_a_hundredth(patch: Patch) -> None:
    """Multiplies by 0.01, which no double is, instead of dividing by 100."""

    def to_wire(original: Any, self: Engine, position: Any) -> Any:
        x, y, z = original(dataclasses.replace(self, scale=1.0), position)
        return 0.01 * x, 0.01 * y, 0.01 * z

    wrap(patch, Engine, "position_to_wire", to_wire)


@mutant("ACC-7", check=OUT, reason="quaternion: worst", axes="blender")
def types_the_root_of_one_half(patch: Patch) -> None:
    """Types √½ with seven digits."""
    patch.setattr(conventions, "_HALF_SQRT", 0.7071068)


@mutant("ACC-7", check=IN, reason="quaternion: worst", axes="unity")
def understands_in_single_precision(patch: Patch) -> None:
    """Says that it holds double precision, and rounds replies to single."""

    def from_wire(original: Any, self: Engine, pose: Pose) -> Pose:
        position, rotation = original(self, pose)
        return Pose(position, tuple(float(np.float32(number)) for number in rotation))  # type: ignore[arg-type]

    wrap(patch, Engine, "from_wire", from_wire)


@mutant(
    "REQ-11",
    check="check_matches_replies_by_their_order",
    reason="the reply to another",
    axes="opencv",
)
def gives_replies_to_the_last_who_asked(patch: Patch) -> None:
    """Takes a reply for that to the last of all open questions of its kind."""

    def answered(original: Any, self: Steering, ticket: int) -> Any:
        asked = [question for question in self._questions if question.ticket == ticket]
        alike = [q for q in self._questions if asked and type(q.request) is type(asked[0].request)]
        for question in asked:
            question.ticket, alike[-1].ticket = alike[-1].ticket, question.ticket
        return original(self, ticket)

    wrap(patch, Steering, "_answered", answered)


# Images


def _whatever_happened(patch: Patch) -> None:
    patch.setattr(FrameLease, "intact", property(lambda self: True))


@mutant(
    "IMG-13",
    check="check_releases_when_it_has_read",
    reason="was released before it was read",
    axes="opencv",
)
def releases_before_it_reads(patch: Patch) -> None:
    """Gives an image back as soon as it has it, and copies it a moment later."""

    def copied(original: Any, lease: FrameLease) -> Copied:
        color, depth, kept = lease.color, lease.depth, (lease.seq, lease.camera, lease.semantics)
        lease.release()
        time.sleep(0.02)
        return Copied(kept[0], np.array(color), np.array(depth), *kept[1:])

    _whatever_happened(patch)
    wrap(patch, mirror, "_copied", copied)


@mutant(
    "IMG-14",
    check="check_reads_only_what_it_holds",
    reason="was shown after the client had given",
    axes="opencv",
)
def keeps_no_copy(patch: Patch) -> None:
    """Shows what lies in the slot now, whether or not it is lent."""

    def copied(original: Any, lease: FrameLease) -> Copied:
        return Copied(lease.seq, lease.color, lease.depth, lease.camera, lease.semantics)

    wrap(patch, mirror, "_copied", copied)


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    reason="it read",
    axes="opencv",
)
def reads_both_channels_always(patch: Patch) -> None:
    """Subscribes to one channel, and reads both."""

    def lend(original: Any, self: Reading, frame: Any, channels: Any) -> None:
        original(self, frame, frozenset(("color", "depth")))

    wrap(patch, Reading, "_lend", lend)


@mutant(
    "IMG-22",
    check="check_reads_only_what_it_subscribed_to",
    reason="it read depth with color",
    axes="opencv",
)
def reads_at_once_what_it_subscribes_to(patch: Patch) -> None:
    """Reads a channel of the next image that comes, which may have crossed its `subscribe`."""

    def subscribe(original: Any, self: IpcProtocol, channels: Any) -> None:
        original(self, channels)
        self._written = channels

    wrap(patch, IpcProtocol, "subscribe", subscribe)


@mutant(
    "CHN-18",
    check="check_leaves_the_buffers_when_the_connection_ends",
    reason="is not what the client read while it was connected",
    axes="opencv",
)
def reads_on_without_a_connection(patch: Patch) -> None:
    """Shows the memory of the slot that it read last while it is not connected."""
    views: list[Any] = []

    def copied(original: Any, lease: FrameLease) -> Any:
        views[:] = [lease.color, lease.depth]
        return original(lease)

    def newest(self: Mirror) -> Any:
        if self._kept is None or self._session.status.ipc.connected:  # type: ignore[attr-defined]
            return self._kept  # type: ignore[attr-defined]
        return self._kept._replace(color=views[0], depth=views[1])  # type: ignore[attr-defined]

    def keep(self: Mirror, image: Any) -> None:
        self._kept = image  # type: ignore[attr-defined]

    wrap(patch, mirror, "_copied", copied)
    patch.setattr(Mirror, "newest", property(newest, keep), raising=False)


# What is shown


@mutant(
    "MEM-13",
    check="check_shows_rows_from_the_bottom_up",
    reason="rows top-down",
    axes="opencv",
)
def forgets_that_rows_are_bottom_up(patch: Patch) -> None:
    """Shows the first row of the memory at the top."""
    for name in ("color", "depth"):
        wrap(patch, HostImages, name, lambda original, self, slot: original(self, slot)[::-1])


@mutant("MEM-13", check=SEMANTICS, reason="(as straight)", axes="opencv")
def blends_premultiplied_as_straight(patch: Patch) -> None:
    """Multiplies colour by alpha once more."""
    patch.setattr(display, "over_premultiplied", over_straight)


def _meant(patch: Patch, **otherwise: Any) -> None:
    def planar(original: Any, color: Any, depth: Any, camera: Any, semantics: Any) -> Any:
        return original(color, depth, camera, semantics._replace(**otherwise))

    wrap(patch, display, "planar_depth", planar)


@mutant("MEM-13", check=SEMANTICS, reason="(as planar_z)", axes="opencv")
def takes_distances_for_depths(patch: Patch) -> None:
    """Compares the distance along the ray with the depth of its own geometry."""
    _meant(patch, depth_kind="planar_z")


@mutant("MEM-13", check=SEMANTICS, reason="(as if inf alone were empty)", axes="opencv")
def knows_one_empty_depth(patch: Patch) -> None:
    """Takes only infinity for empty."""
    _meant(patch, depth_empty=float("inf"))


@mutant(
    "BUF-8",
    check="check_shows_its_geometry_where_the_image_is_empty",
    reason="an empty pixel",
    axes="opencv",
)
def draws_empty_pixels_in_front(patch: Patch) -> None:
    """Takes an infinite depth for none at all, and draws the pixel before everything."""

    def planar(original: Any, color: Any, depth: Any, *rest: Any) -> Any:
        return np.where(np.isposinf(depth), np.float32(0.01), original(color, depth, *rest))

    wrap(patch, display, "planar_depth", planar)


@mutant(
    "BUF-9",
    check="check_takes_no_odd_depth_for_a_surface",
    reason="an opaque pixel",
    axes="opencv",
)
def takes_negative_depths(patch: Patch) -> None:
    """Takes every depth that is less than that of its own geometry for a surface."""

    def planar(original: Any, color: Any, depth: Any, *rest: Any) -> Any:
        return original(color, np.where(depth < 0, np.float32(0.01), depth), *rest)

    wrap(patch, display, "planar_depth", planar)


@mutant("ACC-10", check="check_composes_within_three_ulp", reason="colour: worst", axes="opencv")
def composes_in_eight_bits(patch: Patch) -> None:
    """Truncates the image to eight bits a channel before it blends it."""

    def composed(original: Any, color: Any, *rest: Any) -> Any:
        return original((np.floor(color * 255) / np.float32(255)).astype(np.float32), *rest)

    wrap(patch, adapter, "composed", composed)
