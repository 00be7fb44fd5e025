"""Mutants that break CTL: who steers, who is told that it does not, and what is left behind."""

from splatbus_server.connection import Refusal
from splatbus_server.control import Control
from splatbus_wire.messages import CameraPose, ObjectPose, PointCloudPose, SetTime

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant

TOLD, ONCE = "check_tells_who_has_no_control", "check_tells_it_once"
OTHERS = "check_no_pose_of_another_is_applied"
PASSES = "check_control_passes_with_the_newest_poses"
ENDS, REFUSED = "check_lens_and_time_end_with_their_client", "check_refused_poses_count_for_nothing"


def unsaid(patch, *codes):
    """Do what calls for these errors, and do not say so."""

    def complain(original, self, refusal):
        return refusal if refusal.code in codes else original(self, refusal)

    server.COMPLAINS.wrap(patch, complain)


@mutant("CTL-1", check=TOLD, code="not-told-busy")
def server_does_not_say_that_it_is_busy(patch):
    """Ignores the poses of all but one client, as 1.0 does."""
    unsaid(patch, "busy")


@mutant("CTL-1", check=TOLD, code="not-told-busy", at=server.TAKES_POSE)
def server_is_busy_for_cameras_alone(original, self, connection, message):
    """Says that it is busy when a camera is not moved, and not when the Gaussians are not."""
    if isinstance(message, CameraPose):
        return original(self, connection, message)
    self.told_busy.add(connection)
    refusal = original(self, connection, message)
    self.told_busy.discard(connection)
    return refusal


@mutant("CTL-2", check=ONCE, code="busy-again", at=server.TAKES_POSE)
def server_says_again_that_it_is_busy(original, self, connection, message):
    """Says with each pose that another client has control."""
    self.told_busy.discard(connection)
    return original(self, connection, message)


@mutant("CTL-2", check=ONCE, code="busy-again", at=server.FORGETS_CLIENT)
def server_is_busy_again_for_the_rest(original, self, connection):
    """Tells those who wait that it is busy once more when control has passed to another."""
    if self.control.holder is connection:
        self.told_busy.clear()
    original(self, connection)


@mutant("CTL-3", check=ENDS, code="intrinsics-kept", at=server.PASSES_CONTROL_ON)
def server_keeps_the_lens_of_who_left(original, self, connection):
    """Leaves intrinsics in force when the client that set them has gone."""
    lens = self.poses.intrinsics
    original(self, connection)
    if self.poses.intrinsics is None:
        self.poses = self.poses._replace(intrinsics=lens)


@mutant("CTL-3", check=ENDS, code="intrinsics-kept")
def server_keeps_the_lens_until_the_next_camera(patch):
    """Leaves intrinsics in force when their client has gone, until another poses the camera."""

    def leave(original, self, connection):
        lens, serial = self.poses.intrinsics, self.poses.serial
        had_control = self.holder is connection
        original(self, connection)
        if had_control and self.poses.serial == serial:
            self.poses = self.poses._replace(intrinsics=lens)

    def move(original, self, connection, message):
        lent = isinstance(message, CameraPose) and message.intrinsics is None
        if lent and CameraPose not in self.sent.get(connection, {}):
            self.poses = self.poses._replace(intrinsics=None)
        return original(self, connection, message)

    server.PASSES_CONTROL_ON.wrap(patch, leave)
    server.OBEYS.wrap(patch, move)


@mutant("CTL-4", check=REFUSED, code="refused-pose-gave-control")
def server_gives_control_for_what_it_refuses(patch):
    """Gives control to a client whose intrinsics or object it refuses, if nobody has it."""

    def complain(original, self, refusal):
        if refusal.pointer in ("/intrinsics", "/object") and not control[0].sent:
            control[0].sent[self] = {}
        return original(self, refusal)

    def begin(original, self, poses):
        original(self, poses)
        control[:] = [self]

    control: list[Control] = []
    Seam(Control, "__init__").wrap(patch, begin)
    server.COMPLAINS.wrap(patch, complain)


@mutant("CTL-1", check=TOLD, code="control-not-given", at=server.TAKES_POSE)
def server_says_to_everyone_that_it_is_busy(original, self, connection, message):
    """Says of every pose that another client has control, and applies it if none has."""
    if connection not in self.told_busy:
        self.told_busy.add(connection)
        connection.complain(Refusal("busy", "another client steers the scene"))
    return original(self, connection, message)


@mutant("CTL-4", check=REFUSED, code="wrongly-busy", at=server.COMPLAINS)
def server_is_busy_for_broken_poses(original, self, refusal):
    """Says of every pose that is refused that it is busy, too."""
    if refusal.code in ("unknown_object", "invalid_message") and refusal.pointer:
        original(self, refusal._replace(code="busy"))
    return original(self, refusal)


@mutant("CTL-4", check=REFUSED, code="not-told-busy")
def server_counts_refused_poses(patch):
    """Takes a client whose pose it refuses for one that has been told."""

    def complain(original, self, refusal):
        if refusal.pointer:
            refused.add(id(self))
        if refusal.code == "busy" and id(self) in refused:
            return refusal
        return original(self, refusal)

    refused: set[int] = set()
    server.COMPLAINS.wrap(patch, complain)


@mutant("CTL-5", check=PASSES, code="another-camera", at=server.PASSES_CONTROL_ON)
def server_waits_for_the_next_pose(original, self, connection):
    """Passes control on, and applies what the next client sends from then on."""
    before = self.poses
    original(self, connection)
    self.poses = before._replace(intrinsics=None, time=None)


@mutant("CTL-5", check=PASSES, code="another-placement", at=server.PASSES_CONTROL_ON)
def server_passes_on_the_camera_alone(original, self, connection):
    """Leaves objects where they are when control passes to a client that has placed them."""
    objects = self.poses.objects
    original(self, connection)
    self.poses = self.poses._replace(objects=objects)


@mutant("CTL-5", check=PASSES, code="another-camera", at=server.OBEYS)
def server_remembers_the_first_pose(original, self, connection, message):
    """Keeps the first pose of who has no control, not the newest."""
    known = self.sent.get(connection, {})
    if self.holder not in (None, connection) and type(message) in known:
        return False
    return original(self, connection, message)


@mutant("CTL-5", check=PASSES, code="other-intrinsics", at=server.OBEYS)
def server_forgets_the_lens_of_who_has_no_control(original, self, connection, message):
    """Keeps the newest pose of who has no control, and not the intrinsics that came before it."""
    known = self.sent.get(connection, {})
    if self.holder is not connection and isinstance(former := known.get(CameraPose), CameraPose):
        known[CameraPose] = former._replace(intrinsics=None)
    return original(self, connection, message)


def leaves(patch, **changes):
    """Change what is in force when control has passed on."""

    def leave(original, self, connection):
        had_control = self.holder is connection
        original(self, connection)
        if had_control and self.sent:
            self.poses = self.poses._replace(**changes)

    server.PASSES_CONTROL_ON.wrap(patch, leave)


def obeys(patch, *kinds):
    """Apply poses of these kinds, whoever sends them."""

    def move(original, self, connection, message):
        has_control = original(self, connection, message)
        if not has_control and isinstance(message, kinds):
            self.poses = self.poses.moved_by(message)
        return has_control

    server.OBEYS.wrap(patch, move)


@mutant("POS-11", check=OTHERS, code="applied-without-control")
def server_moves_objects_for_anyone(patch):
    """Applies the poses of objects of every client, and the cameras of one."""
    obeys(patch, PointCloudPose, ObjectPose)


@mutant("POS-11", check=OTHERS, code="applied-without-control")
def server_sets_time_for_anyone(patch):
    """Lets every client set the time."""
    obeys(patch, SetTime)


@mutant("CTL-5", check=PASSES, code="other-intrinsics")
def server_passes_on_no_lens(patch):
    """Leaves out the intrinsics that a client sent before it had control."""
    leaves(patch, intrinsics=None)


@mutant("CTL-5", check=PASSES, code="another-time")
def server_passes_on_no_time(patch):
    """Leaves out the time that a client set before it had control."""
    leaves(patch, time=None)


@mutant("CTL-5", check=PASSES, code="another-tag")
def server_passes_on_no_tag(patch):
    """Leaves out the tag of the camera that a client sent before it had control."""
    leaves(patch, tag=None)


@mutant("CTL-2", check=ONCE, code="busy-again", at=server.TAKES_POSE)
def server_forgets_whom_it_told_with_another_error(original, self, connection, message):
    """Says `busy` again to a client that was sent another error meanwhile."""
    refusal = original(self, connection, message)
    if refusal is not None and refusal.code != "busy":
        self.told_busy.discard(connection)
    return refusal
