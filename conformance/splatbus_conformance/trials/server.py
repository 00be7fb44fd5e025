"""A trial of a server: the harness plays its clients."""

import contextlib
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from splatbus_schemas.requirements import Requirement

from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.pictures import Picture, pictures_of
from splatbus_conformance.plan import Side
from splatbus_conformance.trials import controls
from splatbus_conformance.trials.scripted_client import DialledConnection, ScriptedClient
from splatbus_conformance.trials.testee.process import Launched
from splatbus_conformance.trials.testee.server_probe import GONE_SECONDS, ServerFacts, reach
from splatbus_conformance.trials.trial import (
    EFFECT_SECONDS,
    REACTION_SECONDS,
    LostSign,
    Stand,
    Trial,
)
from splatbus_conformance.wire.json_values import within
from splatbus_conformance.wire.message_kinds import REPLIES
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

GREETINGS = 10
"""How often a server is greeted that closes at once: it may not have seen the last viewer leave."""
LATE_SECONDS = 1.0


class ServerTrial(Trial):
    """What a check of a server has in hand: the viewer that the harness plays as well."""

    side: ClassVar[Side] = "server"

    def __init__(
        self, requirement: Requirement, stand: Stand, viewer: ScriptedClient, facts: ServerFacts
    ) -> None:
        super().__init__(requirement, stand)
        self.viewer = viewer
        self.facts = facts
        self.peer.on_open = viewer.on_open
        self.peer.on_message = viewer.on_message
        self.last_image: CapturedFrame | None = None
        """The last image that was copied."""
        self._mover: Connection | None = None
        self._unheard = False
        """A connection was neither closed nor served."""

    def with_(self, connection: Connection) -> DialledConnection:
        """What was said on a connection."""
        return self.viewer.with_(connection)

    def pictures(self) -> tuple[Picture, ...]:
        """As of every trial; beside what belongs there, where the scene is known."""
        if self.last_image is None:
            return ()
        exact = None
        if self.facts.scene_known:
            with np.errstate(all="ignore"):  # a camera may be anywhere
                exact = render(self.last_image.camera, self.facts.setting(self.last_image.frame))
        return pictures_of(self.last_image, exact)

    # Meeting the testee

    def dial(self, channel: Channel) -> Connection:
        """A new connection that is served, and agreed on nothing.

        To most servers nothing need be said for that; one that requires a token was given it, and
        has said `welcome`.
        """
        if self.facts.unauthorized:
            self.not_observable("the server asks for a token that it was not given")
        if self.viewer.token is None:
            return self.before_hello(channel)
        return self.greeted(channel, capabilities=[])

    def dial_narrowly(self, channel: Channel) -> Connection:
        """The same, where little of what the server sends fits into the systems' buffers."""
        self.peer.narrow = True
        try:
            return self.dial(channel)
        finally:
            self.peer.narrow = False

    def before_hello(self, channel: Channel) -> Connection:
        """A new connection on which nothing was said, for what is said first; starts the server if
        it has ended, which is a vital sign that it has lost, unless the check has ended it.
        """
        if ended := self.testee.ended():
            if not self.killed:
                self.losses.append(LostSign(f"its process {ended}", None, list(self.peer.entries)))
            self.testee.stop()
        self.testee.ensure_running()
        connection = self.reached(channel)
        if connection is None:
            if self.fate() == "dies":
                self.judge("dies", f"a connection to the {channel} channel")
            self.not_observable(f"the server accepts no connection on the {channel} channel")
        return connection

    def greeted(self, channel: Channel, **changes: object) -> Connection:
        """A new connection that was given `welcome`; with members of `hello` changed as named."""
        connection, answer = self.answered(channel, **changes)
        if answer is None:
            self.not_observable("the server answers no hello")
        if answer["type"] != "welcome":
            self.not_observable("the server gives this hello no welcome")
        return connection

    def answered(self, channel: Channel, **changes: object) -> tuple[Connection, Json | None]:
        """A new connection with members of `hello` changed as named, and the answer to that: a
        `welcome` or an `error`; None if the server closes, or says neither in time.
        """
        for _ in range(GREETINGS):
            connection = self.before_hello(channel)
            if self._is_answered_to_hello(connection, changes) or not connection.ended:
                break
            self.rest(0.05)
        return connection, self.with_(connection).answer

    def _is_answered_to_hello(self, connection: Connection, changes: dict[str, object]) -> bool:
        dealings = self.with_(connection)
        self.viewer.greet(connection, **changes)
        self.wait(lambda: dealings.answer or connection.ended)
        return bool(dealings.heard)

    def is_welcomed(self, connection: Connection) -> bool:
        """Whether a hello that was said is answered by `welcome`, in time."""
        dealings = self.with_(connection)
        self.wait(lambda: dealings.welcome or connection.ended)
        return dealings.welcome is not None

    def require_all(self, *connections: Connection) -> None:
        """Skip the check if the server, which may (CHN-13), ends one for those that came later."""
        for connection in connections:
            if connection.channel == "msg" and not connection.ended:
                self.answers(connection)
        if any(connection.ended for connection in connections):
            self.not_observable(f"the server keeps fewer than {len(connections)} connections")

    def ready(self, channel: Channel, **changes: object) -> Connection:
        """A new connection that was given `welcome`, with memory open if the server gives any."""
        connection = self.greeted(channel, **changes)
        self._is_told_of_memory(connection)
        return connection

    def _is_told_of_memory(self, connection: Connection) -> bool:
        """Whether memory is announced in time, as when the server was met, or none is due."""
        dealings = self.with_(connection)
        due = self.facts.opens and bool({"host_shm", "cuda_ipc"} & set(dealings.granted))
        self.wait(lambda: not due or dealings.init_packets or connection.ended)
        return not due or bool(dealings.init_packets)

    def commanding(self, **changes: object) -> Connection:
        """A new message connection that was given `welcome`, from which `move` poses the camera."""
        return self._command_from(self.greeted("msg", **changes))

    def reading(self, **changes: object) -> Connection:
        """A new IPC connection on which images are announced and their memory is open here."""
        connection = self.greeted("ipc", **changes)
        dealings = self.with_(connection)
        if not self.wait(lambda: dealings.memory or dealings.refusal or connection.ended):
            self.not_observable("the server announced no memory")
        if not (dealings.memory or dealings.refusal):
            told = f", saying {', '.join(codes)}" if (codes := dealings.errors()) else ""
            self.not_observable(f"the server ended a reader's connection{told}")
        if dealings.memory is None:
            self.not_observable(f"the memory cannot be opened here: {dealings.refusal}")
        return connection

    @contextlib.contextmanager
    def relaunched(self, **environment: str) -> Iterator[None]:
        """The server is launched anew with these variables, and as usual afterwards."""
        testee = self.testee
        if not isinstance(testee, Launched):
            self.not_observable("only a server that the harness launches can be launched anew")
        token = self.viewer.token
        self.peer.close_all()
        self._mover = None
        try:
            testee.add_to_environment(environment)
            yield
        finally:
            self.peer.close_all()
            testee.add_to_environment({})
            self.viewer.token = token

    # Asking

    def replies(self, connection: Connection) -> list[Json]:
        """Everything on a message connection that is no `welcome` and no `error`, in order."""
        heard = self.with_(connection).heard
        return [message for message in heard if message.get("type") not in ("welcome", "error")]

    def ask(self, connection: Connection, request: Json) -> Json | None:
        """The next thing that the server says after a request; None if it says nothing in time."""
        return next(iter(self.ask_all(connection, [request])), None)

    def ask_all(self, connection: Connection, requests: Sequence[Json]) -> list[Json]:
        """What the server says in time after requests in one write: one thing for each, or more."""
        heard = self.with_(connection).heard
        before = len(heard)
        self.viewer.say(connection, *requests)
        self.grows(connection, heard, before + len(requests) - 1)
        return heard[before:]

    def answers(self, connection: Connection) -> bool:
        """Whether the server answers a good request on this connection: the positive control."""
        dealings = self.with_(connection)
        by_id = self._tells_ids(connection)
        return self._is_answered(connection, [controls.one(by_id, dealings.said, dealings.heard)])

    def _tells_ids(self, connection: Connection) -> bool:
        welcome = self.with_(connection).welcome
        return self.facts.repeats_ids and within(welcome, "version") == "1.1"

    def _is_answered(self, connection: Connection, requests: list[Json]) -> bool:
        heard = self.with_(connection).heard
        before = len(heard)
        self.viewer.say(connection, *requests)
        self.wait(lambda: controls.are_answered(requests, heard[before:]) or connection.ended)
        self.controls += (came := controls.are_answered(requests, heard[before:]))
        return came

    # Scripts, and what becomes of them

    def judge(self, outcome: str, what: str) -> None:
        """The same; who had to say hello may be told by an `error` what is ignored."""
        acceptable, says_hello = self.requirement.acceptable, self.viewer.token or self.facts.plays
        if outcome == "reports" and says_hello and outcome not in acceptable:
            outcome = "ignores"
        super().judge(outcome, what)

    def outcome_on_msg(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on a message connection, then good requests as the control, for whose
        replies none to the scripts can be taken.

        Returns `ignores` (the good requests were answered, and nothing else), `reports` (so was the
        script, by an `error`), `replies` (by something else), `closes` (and a new connection is
        served), `exits`, `dies` or `hangs`.
        """
        dealings = self.with_(connection)
        before = len(dealings.heard)
        for script in scripts:
            connection.send(script)
        requests = controls.both(self._tells_ids(connection))
        if self._is_answered(connection, requests):
            said = [message.get("type") for message in dealings.heard[before:]]
            if len(said) == len(requests):
                return "ignores"
            return "reports" if said.count("error") == len(said) - len(requests) else "replies"
        return self.end_of(connection, LATE_SECONDS)  # it was waited for while an answer was

    def outcome_on_ipc(self, connection: Connection, *scripts: bytes) -> str:
        """Deliver scripts on an IPC connection; the control is that images still follow the camera,
        or, where none can, that the connection stays open.

        Returns `ignores`, `reports`, `replies`, `closes` (and a new connection is served),
        `exits`, `dies` or `hangs`.
        """
        dealings = self.with_(connection)
        errors, before = len(dealings.errors()), len(dealings.heard)
        for script in scripts:
            connection.send(script)
        if not self._is_told_of_memory(connection):
            return self.end_of(connection)
        if dealings.memory is not None and "frames" in dealings.granted:
            goes_on = self.sees(connection, self.move()) is not None
        else:
            self.wait(lambda: connection.ended, REACTION_SECONDS)
            goes_on = not connection.ended
        if goes_on and not connection.ended:
            self.controls += 1
            if any(it.get("type") in REPLIES for it in dealings.heard[before:]):
                return "replies"
            return "reports" if len(dealings.errors()) > errors else "ignores"
        return self.end_of(connection)

    def serves(self) -> bool:
        """Whether new connections are served on both channels: requests are answered on one, and
        on the other whatever the server says first was said.

        Beside another of ours, a new one may be closed instead (CHN-13).
        """
        return not self.fate() and self._serves_on("msg") and self._serves_on("ipc")

    def _serves_on(self, channel: Channel, until: float = 0.0) -> bool:
        said_first = self.facts.welcome[channel] or self.facts.at_once
        if not self.facts.listens[channel] or (channel == "ipc" and not said_first):
            return True
        connection = self.served(channel)
        if connection is None:
            return False
        heard = self.with_(connection).heard
        if channel == "msg":
            served = self.answers(connection)
        else:
            if self.facts.welcome[channel] and self.viewer.token is None:
                self.viewer.greet(connection, capabilities=[])
            served = self.grows(connection, heard)
        others = (c for c in self.peer.connections if c.channel == channel and c is not connection)
        served = served or (connection.ended is not None and any(not c.gone for c in others))
        until = until or self.peer.clock() + EFFECT_SECONDS
        if not served and connection.ended and self.peer.clock() < until:
            self.rest(GONE_SECONDS)  # it has not seen yet, perhaps, who has gone
            return self._serves_on(channel, until)
        connection.close()
        return served

    def served(self, channel: Channel) -> Connection | None:
        """A new connection, on which a token was said if the server requires one; None if it
        accepts none.
        """
        connection = self.reached(channel)
        if connection is not None and self.viewer.token is not None:
            self.viewer.greet(connection, capabilities=[])
        return connection

    def reached(self, channel: Channel) -> Connection | None:
        """A new connection on which nothing was said, or None; where one is served at a time and
        none is held, one that stays.

        There, the next is refused until the server has seen that the last has gone.
        """
        kept = (c for c in self.peer.connections if c.channel == channel)
        retries = self.facts.alone[channel] and all(c.gone for c in kept)
        deadline = self.peer.clock() + EFFECT_SECONDS
        while True:
            connection = reach(self.peer, self.testee, channel, self.patience)
            if connection is None or not retries:
                return connection
            self._take_place(connection)
            if not connection.ended or self.peer.clock() > deadline:
                return connection
            connection.close()

    def _take_place(self, connection: Connection) -> None:
        """Wait until it is closed, or served, which an answer shows; that is forgotten."""
        asks = connection.channel == "msg" and self.facts.answers and not self._unheard
        if not asks or self.facts.welcome["msg"]:
            self.rest(GONE_SECONDS)
            return
        self.viewer.say(connection, controls.VIEWPORT_REQUEST)
        self._unheard = not (self.grows(connection, connection.messages) or connection.ended)
        connection.messages.clear()
        self.with_(connection).heard.clear()

    def end_of(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> str:
        """What becomes of a connection that is to end within this time: `closes` (and new ones are
        served), `exits`, `dies` or `hangs`.
        """
        if self.ends(connection, seconds):
            connection.close()
            if self.serves():
                return "closes"
        self.wait(self.fate, 0.05)
        return self.fate() or "hangs"

    # Images

    def move(self, pose: Json | None = None) -> Json:
        """Pose the camera, from the first connection of this trial to pose (POS-11): where it has
        not been lately, unless it is told where. The scene is put where it was at first (POS-13).
        Returns the pose.
        """
        mover = self.mover()
        if pose is None:
            pose = controls.next_pose()
        self.viewer.say(mover, pose)
        return pose

    def mover(self) -> Connection:
        """The connection from which `move` poses."""
        if self._mover is None or self._mover.gone:
            plays = self.facts.plays
            mover = self.greeted("msg", capabilities=["time"]) if plays else self.dial("msg")
            self.viewer.say(mover, camera_pose(kind="point_cloud_pose"))
            return self._command_from(mover)
        return self._mover

    def pass_control(self, connection: Connection) -> None:
        """Pose from this connection from now on; that from which `move` has posed is closed.

        A scene that plays is stopped at the time of its first image, where that was granted: what
        is seen of two poses can be compared then (TIM-2).
        """
        if self._mover is not None:
            self._mover.close()
        self._command_from(connection)

    def _command_from(self, connection: Connection) -> Connection:
        self._mover, first = connection, self.facts.first
        if self.facts.plays and first and "time" in self.with_(connection).granted:
            self.viewer.say(connection, {"type": "set_time", "time": first.frame["time"]})
        return connection

    def sees(
        self, connection: Connection, pose: Json, seconds: float = EFFECT_SECONDS
    ) -> Json | None:
        """The first frame on this connection that was rendered from this pose, if it comes."""
        frames = self.with_(connection).frames
        others = 0

        def found() -> Json | None:
            nonlocal others
            while others < len(frames) and not controls.shows(frames[others], pose):
                others += 1
            return frames[others] if others < len(frames) else None

        self.wait(lambda: found() or connection.ended, seconds)
        return found()
