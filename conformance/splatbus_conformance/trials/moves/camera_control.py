"""Steer a server, and see by the `camera` of its frames which pose is in force (IMG-5)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.nudging import Nudging
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, JITTER_SECONDS
from splatbus_conformance.wire.json_values import finites, within
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

CLOSENESS = 1e-5
"""How far a number of a pose in force may be from the one that was sent, absolute or relative."""


class RenderedCamera(NamedTuple):
    """What a frame was rendered with: position x, y, z and unit quaternion x, y, z, w."""

    position: tuple[float, ...]
    rotation: tuple[float, ...]

    def shows(self, other: "RenderedCamera") -> bool:
        """Whether both are the same pose; q and −q are the same rotation."""
        turned = tuple(-part for part in other.rotation)
        return _close(self.position, other.position) and (
            _close(self.rotation, other.rotation) or _close(self.rotation, turned)
        )

    def __str__(self) -> str:
        return f"position {_rounded(self.position)}, rotation {_rounded(self.rotation)}"


def camera_of(pose: Json) -> RenderedCamera:
    """The camera that a valid pose message asks for."""
    return RenderedCamera(
        tuple(float(pose["position"][name]) for name in "xyz"),
        _unit([float(pose["rotation"][name]) for name in "xyzw"]),
    )


class CameraControl:
    """A viewer that reads frames on one connection, while others send poses."""

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial
        self.reader = trial.reading()
        self._frames = trial.with_(self.reader).frames
        self._nudges = Nudging(trial, self._frames)
        self._was_nudged = False
        if not trial.wait(lambda: self._frames or self.reader.ended):
            fell_silent(trial, self.reader, "the server sent no frame")

    @property
    def count(self) -> int:
        """How many frames came."""
        return len(self._frames)

    def cameras(self, since: int = 0) -> list[RenderedCamera]:
        """What the frames past so many were rendered with; those that do not say are left out."""
        return [camera for frame in self._frames[since:] if (camera := camera_in(frame))]

    def now(self) -> RenderedCamera:
        """What the newest frame was rendered with."""
        newest = next(filter(None, map(camera_in, reversed(self._frames))), None)
        if newest is None:
            self.trial.not_observable("no frame says with which camera it was rendered")
        return newest

    def shows_now(self, pose: Json) -> bool:
        """Whether the newest frame shows a pose."""
        return self.now().shows(camera_of(pose))

    def shows(self, connection: Connection, pose: Json, payload: bytes | None = None) -> bool:
        """Send a valid pose, spelled so, until a frame shows it that was rendered afterwards;
        whether one does in time. That frame is the newest then, or as new.
        """
        clock, sent = self.trial.peer.clock, packet(payload or encode(pose))
        deadline = clock() + EFFECT_SECONDS
        while clock() < deadline and not connection.ended and not self.trial.fate():
            if self._nudges.shown(connection, sent) and self.shows_now(pose):
                self._was_nudged = True
                return True
            self.trial.rest(JITTER_SECONDS)
        return False

    def takes(self, connection: Connection, pose: Json, payload: bytes | None = None) -> str:
        """What becomes of a valid pose: `accepts`, `ignores`, `closes`, `exits` or `dies`."""
        if self.shows(connection, pose, payload):
            return "accepts"
        return self.trial.fate() or ("closes" if connection.ended else "ignores")

    def nudged(self, connection: Connection, since: int | None = None) -> list[RenderedCamera]:
        """Move the Gaussians, so that an image is due; the cameras since then, or since earlier.

        The last of them was rendered after all that was sent before and has been handled. The
        connection has to be in control, or to get it by this.
        """
        since = self.count if since is None else since
        if not self.renders_for(connection):
            what = "the server sent no frame after the Gaussians had moved"
            if self._was_nudged:
                fell_silent(self.trial, self.reader, what)
            self.trial.not_observable(what)
        return self.cameras(since)

    def renders_for(self, connection: Connection) -> bool:
        """Move the Gaussians; whether a frame comes in time that shows it."""
        came = self._nudges.shown(connection)
        self._was_nudged |= came
        return came

    def outcome_of(self, connection: Connection, payload: bytes) -> str:
        """Send what must not move the camera, from the connection in control.

        Returns `keeps`, `applies` (the camera is another now), `closes`, `exits`, `dies` or
        `hangs`. Where the connection is closed, control may pass on, and with it the camera.
        """
        former, before = self.now(), self.count
        outcome = self.trial.outcome_on_msg(connection, packet(payload))
        if outcome not in ("ignores", "reports", "replies"):
            return outcome
        if not self.renders_for(connection):
            return "hangs"
        kept = all(camera.shows(former) for camera in self.cameras(before))
        return "keeps" if kept else "applies"


def camera_in(frame: Json) -> RenderedCamera | None:
    """What a frame was rendered with, if it says so."""
    position = finites(within(frame, "camera", "position"), 3)
    rotation = finites(within(frame, "camera", "rotation"), 4)
    return RenderedCamera(position, _unit(rotation)) if position and rotation else None


def _unit(rotation: Sequence[float]) -> tuple[float, ...]:
    norm = math.hypot(*rotation)
    return tuple(part / norm for part in rotation) if norm > 0 else tuple(rotation)


def _close(some: tuple[float, ...], others: tuple[float, ...]) -> bool:
    return all(
        math.isclose(a, b, rel_tol=CLOSENESS, abs_tol=CLOSENESS)
        for a, b in zip(some, others, strict=True)
    )


def _rounded(values: tuple[float, ...]) -> list[float]:
    return [round(value, 4) for value in values]
