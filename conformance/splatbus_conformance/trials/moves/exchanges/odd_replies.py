"""Requests of a client, answered as a check wants it: late, and with cameras of its choice."""

import time
from typing import Any

from splatbus_conformance.cases.valid.numbers import nearest, unquoted
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.message_kinds import REQUESTS
from splatbus_conformance.wire.messages import Json, reply
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

_REPLY = reply({"type": "get_camera_pose", "cam_idx": 0}, typed=False) or {}
ROLES_OWN = Pose.of((_REPLY["position"], _REPLY["rotation"]))
"""Where every camera is that a role tells by itself."""


class OddReplies:
    """Takes the place of a role's own replies.

    Attributes:
        cameras: poses on the wire; index i asks for the one at i modulo their number (REQ-6).
        position: texts of three numbers that stand for that of every camera, if there are any.
        holds: requests wait for `answer_all`.
        took: seconds from the last `ask` to the first reply.
        told: poses on the wire that replies held since the last `ask`, by their camera.
    """

    def __init__(self, trial: ClientTrial) -> None:
        self.cameras = [ROLES_OWN]
        self.position: tuple[str, ...] = ()
        self.holds = False
        self.waiting: list[tuple[Connection, Json]] = []
        self.told: dict[int, list[Pose]] = {}
        self.took = self._asked = 0.0
        self._former: dict[int, list[Pose]] = {}
        self._trial = trial
        self._on_former_packet = trial.peer.on_message
        trial.role.replies = False
        trial.peer.on_message = self._on_message

    def ask(self, requests: list[Any]) -> None:
        """Have the client make these requests, and do not wait for what it makes of the replies."""
        self._former |= {index: poses[-1:] for index, poses in self.told.items()}
        self.told = {}
        self.took, self._asked = 0.0, time.monotonic()
        self._trial.give("ask", requests=requests)

    def possible(self, index: int) -> list[Pose]:
        """Poses of which one is that of this camera, for all that the client can know.

        It may have asked by itself before it was told to, and need not ask twice.
        """
        index %= len(self.cameras)
        return self._former.get(index, [ROLES_OWN]) + self.told.get(index, [])

    def answer_all(self) -> None:
        """Answer what waits, in order, and from now on at once."""
        self.holds = False
        for connection, request in self.waiting:
            self._answer(connection, request)
        self.waiting = []

    def _on_message(self, connection: Connection, arrived: Message) -> None:
        heard = self._trial.with_(connection).heard
        before = len(heard)
        self._on_former_packet(connection, arrived)
        for message in heard[before:]:
            if connection.channel == "msg" and message.get("type") in REQUESTS:
                self.waiting.append((connection, message))
        if not self.holds:
            self.answer_all()

    def _answer(self, connection: Connection, request: Json) -> None:
        role = self._trial.role
        answer = role.answer(connection, request)
        if answer is None:
            return
        if "position" in answer:
            index = (whole(request.get("cam_idx")) or 0) % len(self.cameras)
            camera = self.cameras[index]
            answer |= {"position": list(camera.position), "rotation": list(camera.rotation)}
            if self.position:
                answer["position"] = [f"<{text}>" for text in self.position]
                camera = camera._replace(position=tuple(map(nearest, self.position)))
            self.told.setdefault(index, []).append(camera)
        connection.send(packet(unquoted(role.encode["msg"](answer))))
        self.took = self.took or time.monotonic() - self._asked
