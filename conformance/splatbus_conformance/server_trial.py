"""A trial of a server: the harness plays its clients."""

from typing import NamedTuple

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.lenient_json import read
from splatbus_conformance.memory_reading import Pixels
from splatbus_conformance.messages import Json
from splatbus_conformance.peer import Connection, Peer
from splatbus_conformance.recording import Channel
from splatbus_conformance.server_introduction import ServerFacts, reach
from splatbus_conformance.testee import Testee
from splatbus_conformance.trial import EFFECT_SECONDS, REACTION_SECONDS, Trial
from splatbus_conformance.viewer import Viewer

VIEWPORT_REQUEST: Json = {"type": "get_viewport_size"}


class Image(NamedTuple):
    """A frame that was lent, and a copy of what lay in its slot while it was."""

    frame: Json
    color: Pixels
    """(h, w, 4) float32, rows top-down."""
    depth: Pixels
    """(h, w) float32, rows top-down."""


class ServerTrial(Trial):
    """What a check of a server has in hand: the viewer that the harness plays as well."""

    def __init__(
        self,
        requirement: Requirement,
        peer: Peer,
        viewer: Viewer,
        testee: Testee,
        facts: ServerFacts,
        patience: float,
    ) -> None:
        super().__init__(requirement, peer, testee, patience)
        self.viewer = viewer
        self.facts = facts
        peer.on_open = viewer.on_open
        peer.on_packet = viewer.on_packet

    # Meeting the testee

    def dial(self, channel: Channel) -> Connection:
        """A new connection, on which nothing was said yet; starts the server if it has ended."""
        if self.testee.ended() is not None:
            self.testee.stop()
        self.testee.ensure_running()
        connection = reach(self.peer, self.testee, channel, self.patience)
        if connection is None:
            self.not_observable(f"the server accepts no connection on the {channel} channel")
        return connection

    def greeted(self, channel: Channel, **changes: object) -> Connection:
        """A new connection that was given `welcome`; with members of `hello` changed as named."""
        connection = self.dial(channel)
        self.viewer.greet(connection, **changes)
        if not self.wait(lambda: self.viewer.with_(connection).welcome or connection.ended):
            self.not_observable("the server answers no hello")
        if self.viewer.with_(connection).welcome is None:
            self.not_observable("the server gives this hello no welcome")
        return connection

    def reading(self, **changes: object) -> Connection:
        """A new IPC connection on which images are announced and their memory is open here."""
        connection = self.greeted("ipc", **changes)
        dealings = self.viewer.with_(connection)
        if not self.wait(lambda: dealings.memory or dealings.refusal or connection.ended):
            self.not_observable("the server announced no memory")
        if dealings.memory is None:
            self.not_observable(f"the memory cannot be opened here: {dealings.refusal}")
        return connection

    # Asking

    def replies(self, connection: Connection) -> list[Json]:
        """Everything on a message connection that is no `welcome` and no `error`, in order."""
        return [
            message
            for message in self.viewer.with_(connection).heard
            if message.get("type") not in ("welcome", "error")
        ]

    def ask(self, connection: Connection, request: Json) -> Json | None:
        """The next thing that the server says after a request; None if it says nothing in time."""
        heard = self.viewer.with_(connection).heard
        before = len(heard)
        self.viewer.say(connection, request)
        self.wait(lambda: len(heard) > before or connection.ended)
        return heard[before] if len(heard) > before else None

    def answers(self, connection: Connection) -> bool:
        """Whether the server answers a good request on this connection: the positive control."""
        packets = len(connection.packets)
        self.viewer.say(connection, VIEWPORT_REQUEST)

        def came() -> bool:
            values = (read(packet.payload).value or {} for packet in connection.packets[packets:])
            return any("viewport_size" in value for value in values)

        self.wait(lambda: came() or connection.ended)
        self.delivered += came()
        return came()

    # Scripts, and what becomes of them

    def outcome_on_msg(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on a message connection, then a good request as the control.

        Returns `ignores` (the good request was answered, and nothing else), `reports` (so was the
        script, by an `error`), `replies` (by something else), `closes` (and a new connection is
        served), `exits`, `dies` or `hangs`.
        """
        heard = self.viewer.with_(connection).heard
        before = len(heard)
        for script in scripts:
            connection.send(script)
        answered = self.answers(connection)
        said = [message.get("type") for message in heard[before:]]
        if answered:
            if len(said) == 1:
                return "ignores"
            return "reports" if set(said[:-1]) == {"error"} else "replies"
        return self._end_of(connection)

    def outcome_on_ipc(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on an IPC connection; the control is that images still come, or, where
        none can, that the connection stays open.

        Returns `ignores`, `reports`, `closes` (and a new connection is served), `exits`, `dies` or
        `hangs`.
        """
        dealings = self.viewer.with_(connection)
        errors, frames = len(dealings.errors()), len(dealings.frames)
        for script in scripts:
            connection.send(script)
        if dealings.memory is not None:
            self.viewer.say(connection, {"type": "subscribe", "channels": ["color", "depth"]})
            self.wait(lambda: len(dealings.frames) > frames or connection.ended)
            goes_on = len(dealings.frames) > frames
        else:
            self.wait(lambda: connection.ended, REACTION_SECONDS)
            goes_on = not connection.ended
        if goes_on and not connection.ended:
            self.delivered += 1
            return "reports" if len(dealings.errors()) > errors else "ignores"
        return self._end_of(connection)

    def serves(self) -> bool:
        """Whether the server answers a request on a new connection."""
        if self.fate():
            return False
        connection = reach(self.peer, self.testee, "msg", self.patience)
        served = connection is not None and self.answers(connection)
        if connection is not None:
            connection.close()
        return served

    def ends(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> bool:
        """Whether the server ends this connection in time."""
        return self.wait(lambda: connection.ended, seconds)

    def _end_of(self, connection: Connection) -> str:
        self.wait(lambda: connection.ended, EFFECT_SECONDS)
        self.wait(self.fate, 0.05)
        if fate := self.fate():
            return fate
        served = self.serves()
        if connection.ended:
            return "closes" if served else self.fate() or "hangs"
        return self.fate() or "hangs"

    # Images

    def image(self, connection: Connection, after: int = 0) -> Image:
        """The next image past so many frames of this connection, copied before it is released.

        Only with `viewer.releases` off; skips the check if none comes in time.
        """
        dealings = self.viewer.with_(connection)
        self.wait(lambda: len(dealings.frames) > after or connection.ended)
        if len(dealings.frames) <= after or dealings.memory is None:
            self.not_observable("the server sent no further frame")
        frame = dealings.frames[after]
        slot = int(frame["slot"])
        image = Image(frame, dealings.memory.color(slot), dealings.memory.depth(slot))
        self.viewer.release(connection, frame)
        return image
