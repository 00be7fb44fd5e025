"""Requests of a client, answered as a check wants it: late, and with cameras of its choice."""

from splatbus_conformance.cases.valid.numbers import unquoted
from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.message_kinds import REQUESTS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.packets import Packet, packet
from splatbus_conformance.wire.sockets import Connection


class OddReplies:
    """Takes the place of a role's own replies.

    Attributes:
        cameras: poses on the wire; index i asks for the one at i modulo their number (REQ-6).
        position: texts of three numbers that stand for that of every camera, if there are any.
        holds: requests wait for `answer_all`.
    """

    def __init__(self, trial: ClientTrial) -> None:
        self.cameras = [Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))]
        self.position: tuple[str, ...] = ()
        self.holds = False
        self.waiting: list[tuple[Connection, Json]] = []
        self._trial = trial
        self._former = trial.peer.on_packet
        trial.role.replies = False
        trial.peer.on_packet = self._on_packet

    def answer_all(self) -> None:
        """Answer what waits, in order, and from now on at once."""
        self.holds = False
        for connection, request in self.waiting:
            self._answer(connection, request)
        self.waiting = []

    def _on_packet(self, connection: Connection, arrived: Packet) -> None:
        heard = self._trial.role.with_(connection).heard
        before = len(heard)
        self._former(connection, arrived)
        for message in heard[before:]:
            if connection.channel == "msg" and message.get("type") in REQUESTS:
                self.waiting.append((connection, message))
        if not self.holds:
            self.answer_all()

    def _answer(self, connection: Connection, request: Json) -> None:
        role = self._trial.role
        reply = role.answer(connection, request)
        if reply is None:
            return
        if "position" in reply:
            camera = self.cameras[(whole(request.get("cam_idx")) or 0) % len(self.cameras)]
            reply |= {"position": list(camera.position), "rotation": list(camera.rotation)}
            if self.position:
                reply["position"] = [f"<{text}>" for text in self.position]
        connection.send(packet(unquoted(role.encode["msg"](reply))))
