"""A client of 1.1 that says all that it may, and sees in images what comes of it."""

import contextlib
import itertools
from collections.abc import Iterator
from typing import Any

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.reprojection import AS_SPECIFIED, named
from splatbus_conformance.trials.moves.frame_capture import AT_REST, FrameCapture
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.nudging import Nudging
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

STEP = 2.0**-8
"""How far apart the cameras are from which is looked, in scene units."""
LENS = ("fx", "fy", "cx", "cy", "near", "far")
NARROW: Json = dict.fromkeys(("fx", "fy"), 1.0) | {
    "cx": 0.5,
    "cy": 0.5,
    "width": 1,
    "height": LIMITS["max_image_size"],
    "near": 0.01,
    "far": 100.0,
}
"""Intrinsics of another shape than any image has that is more than a pixel wide."""
_looks = itertools.count(1)


class ImageSession:
    """A client in control of the camera, and a reader of the images.

    Args:
        trial: of a server.
        changes: members of the client's `hello` that are other than usual.

    Attributes:
        poser: the client's message connection.
        capture: of the images, by poses that go over that connection.
    """

    def __init__(self, trial: ServerTrial, **changes: object) -> None:
        self.trial = trial
        self.poser = trial.commanding(**changes)
        self.capture = FrameCapture(trial)
        self._looked = False
        self._nudges = Nudging(trial, self.frames, self.capture.new)
        self.look(placed(DEFAULT, AT_REST) if trial.facts.grants("objects") else at_rest())

    @property
    def heard(self) -> list[Json]:
        """All that the server said on the message connection; it grows."""
        return self.trial.with_(self.poser).heard

    @property
    def frames(self) -> list[Json]:
        """All frames that came; it grows."""
        return self.capture.dealings.frames

    def say(self, *messages: Json) -> None:
        """Send messages from the client in control."""
        for message in messages:
            self.trial.viewer.say(self.poser, message)

    def look(self, *messages: Json, **members: Any) -> CapturedFrame:
        """The first image after these messages, from a camera next to the first view: whoever
        shows it has handled them. `members` are added to the pose of that camera.
        """
        return self.take(self.elsewhere(), *messages, **members)

    def take(self, camera: Pose, *messages: Json, **members: Any) -> CapturedFrame:
        """The first image from this camera after these messages; skips the check if there was
        never one.
        """
        self.say(*messages)
        photograph = self.capture.take(camera, None, **members)
        if named(photograph.camera.pose, camera) is not AS_SPECIFIED:
            what = f"no image shows the camera at {camera}"
            if self._looked:
                fell_silent(self.trial, self.capture.reader, what)
            self.trial.not_observable(what)
        self._looked = True
        return photograph

    def nudged(self, since: int) -> list[Json]:
        """The frames past so many, up to one that was rendered after all that was said: whatever
        had an effect shows it there. Only the Gaussians are moved, a little.
        """
        moved = self._nudges.shown(self.poser)
        self.trial.expect(
            moved, "no-frame", "the Gaussians were moved, as before, and no frame shows it"
        )
        return self.frames[since:]

    def elsewhere(self) -> Pose:
        """A camera next to the first view, where none was lately."""
        return elsewhere(self.trial)

    def end(self) -> str:
        """What the server did in place of an answer."""
        return self.trial.fate() or ("closes" if self.poser.ended else "hangs")

    def answers(self) -> bool:
        """Whether the client in control is answered, after all that it said before."""
        return answers(self.trial, self.poser)


@contextlib.contextmanager
def image_session(trial: ServerTrial) -> Iterator[ImageSession]:
    """One whose objects are put back at the end: they stay where they are otherwise."""
    it = ImageSession(trial)
    try:
        yield it
    finally:
        if trial.facts.grants("objects"):
            it.say(*(placed(name, AT_REST) for name in trial.facts.objects()))
            it.answers()


def elsewhere(trial: ServerTrial) -> Pose:
    """A camera next to the first view, where none was lately."""
    first = trial.facts.first
    position, rotation = first.pose if first else AT_REST
    row, column = divmod(next(_looks), 16)
    x, y, z = position
    return Pose((x + STEP * column, y - STEP * (row % 16), z), rotation)


def answers(trial: ServerTrial, connection: Connection) -> bool:
    """Whether a request on this connection is answered by its reply, after what was said before."""
    return trial.answers(connection) and not connection.ended


def errors_after(
    trial: ServerTrial, connection: Connection, payload: bytes
) -> tuple[list[Json], bool]:
    """Those that come of a packet, and whether a request behind it is answered."""
    heard = trial.with_(connection).heard
    before = len(heard)
    connection.send(packet(payload))
    answered = answers(trial, connection)
    return [it for it in heard[before:] if it.get("type") == "error"], answered


def expect_error(
    trial: ServerTrial, errors: list[Json], code: str, pointer: str, what: str
) -> None:
    """What a client sent was answered by this error, and by no other."""
    codes = [(it.get("code"), it.get("pointer")) for it in errors]
    trial.expect(
        codes == [(code, pointer)],
        "another-error" if codes else "no-error",
        f"{what} was answered by {show(codes or 'no error')}",
    )


def further(trial: ServerTrial, *others: Connection) -> Connection:
    """One more message client; skips the check where the server serves fewer at a time."""
    connection = trial.greeted("msg")
    answered = answers(trial, connection)
    trial.expect(
        answered or connection.ended,
        "left-waiting",
        "a further connection is neither served nor closed",
    )
    if not answered or any(other.ended for other in others):
        count = len(others) + 1
        trial.not_observable(f"the server serves fewer than {count} message connections at a time")
    return connection


def placed(name: str, pose: Pose, scale: float | None = None) -> Json:
    """An `object_pose`."""
    added: Json = {} if scale is None else {"scale": scale}
    return camera_pose(*pose, kind="object_pose") | {"object": name} | added


def at_rest() -> Json:
    """A `point_cloud_pose` that puts the Gaussians where they were at first."""
    return camera_pose(*AT_REST, kind="point_cloud_pose")


def refused_poses(trial: ServerTrial) -> list[Json]:
    """Poses that are refused on a connection of 1.1: by POS-2, POS-3, CAM-9 and CAM-6."""
    found = [
        camera_pose((1e39, 0.0, 0.0)),
        camera_pose(rotation=(0.0, 0.0, 0.0, 2.0)),
        camera_pose() | {"tag": ""},
    ]
    if trial.facts.grants("intrinsics") and trial.facts.size[0] > 1:
        found.append(camera_pose() | {"intrinsics": NARROW})
    return found
