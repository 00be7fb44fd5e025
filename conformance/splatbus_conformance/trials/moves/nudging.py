"""An image that is due: what must not come had the time in which it would have come.

A server that drops what it was sent looks like one that has not come to it yet. So the Gaussians
are moved, by a message that leaves the camera alone: a frame lists where they are (OBJ-7), and one
that lists them there was rendered with all that had arrived before, and was to be applied (POS-7).
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Any

from splatbus_conformance.images.pinhole import told_of
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import DEFAULT
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import numbers
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

AGAIN_SECONDS = 0.5
"""After which a pose is sent again, as viewers do: a connection that held control may linger."""
STEP, STEPS = 2.0**-14, 1023
"""How far apart the places of the Gaussians are, and how many: each exact in single precision."""
UNNAMED = 3
"""Frames of a server that does not list its objects: one was on its way, and one had begun."""
_steps = itertools.count()


class Nudging:
    """Moves the Gaussians by a little, and waits until a frame shows it."""

    def __init__(
        self,
        trial: ServerTrial,
        frames: Sequence[Json],
        give_back: Callable[[], object] = lambda: None,
    ) -> None:
        """Begin.

        Args:
            trial: whose testee it is.
            frames: those that came; it grows.
            give_back: releases what came, where the viewer does not.
        """
        self.trial = trial
        self._frames = frames
        self._give_back = give_back
        self._named = True

    def shown(self, connection: Connection, *before: bytes) -> bool:
        """Whether a frame comes in time that was rendered after all that was sent so far, and then
        these packets, had been handled.

        The connection has to be in control, or to get it by this; all is sent again meanwhile.
        """
        since = came = len(self._frames)
        places = set[float | None]()

        def says_so() -> bool:
            self._give_back()
            return any(_place(frame) in places for frame in self._frames[since:])

        def is_due() -> bool:
            return says_so() or not (self._named or len(self._frames) == came)

        clock = self.trial.peer.clock
        deadline = clock() + EFFECT_SECONDS
        while clock() < deadline and not connection.ended and not self.trial.fate():
            place, came = STEP * (1 + next(_steps) % STEPS), len(self._frames)
            places.add(place)
            moved = camera_pose((0.0, 0.0, place), kind="point_cloud_pose")
            connection.send(b"".join((*before, packet(encode(moved)))))
            self.trial.wait(is_due, AGAIN_SECONDS)
            if says_so():
                return True
            if len(self._frames) - since >= UNNAMED:
                self._named = False
                return True
        return False


def _place(frame: Json) -> float | None:
    """Where a frame has the Gaussians, along z; None where it does not say."""
    position: Any = (told_of(frame, DEFAULT) or {}).get("position")
    return float(position[2]) if numbers(position, 3) else None
