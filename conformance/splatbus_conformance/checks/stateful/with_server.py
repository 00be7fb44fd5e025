"""The clients' part in sessions with a server: several on each channel, good and bad ones."""

import itertools
import time
from collections.abc import Callable, Iterator, Sequence

from splatbus_conformance.checks.stateful import SessionBreach, Step
from splatbus_conformance.checks.stateful.knowledge import CAMERAS, SEATS, Knowledge, crowd, forget
from splatbus_conformance.checks.stateful.scripted_clients import VIEWPORT, Asker, Reader
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import WORDS, Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

RESEND_SECONDS = 0.1
"""How often whoever moves the camera says so again while an image of it is awaited."""
END_SECONDS = 1.0
"""How long a half-closed connection is kept for its end."""
ENDS = ("close", "reset", "end")
PAUSES = (0.001, 0.01)
POSES = ("camera_pose", "point_cloud_pose")
WANTED = (("color",), ("depth",), ("color", "depth"))
HALF = len(packet(encode(VIEWPORT_REQUEST))) // 2
EVERYTHING = (
    *("ask", "pose", "look", "connect", "drop", "hold", "release"),
    *("half", "complete", "subscribe", "stall"),
)


class WithServer:
    """The clients' part in one session.

    Clients have seats, numbered from 0 on each channel. An image is announced to a client that
    moves its camera elsewhere each time, so that it is known whose pose an image shows.

    Args:
        trial: with the server.
        knowledge: of what it serves.
        numbers: of poses, none twice with one server.
        counting: how many clients it serves is counted at the end.
    """

    def __init__(
        self, trial: ServerTrial, knowledge: Knowledge, numbers: Iterator[int], counting: bool
    ) -> None:
        self.trial, self.viewer, self.knowledge = trial, trial.viewer, knowledge
        self._numbers, self._counting = numbers, counting
        self._askers: dict[int, Asker] = {}
        self._readers: dict[int, Reader] = {}
        self._movers: list[Asker] = []
        """Those that are open and have sent a valid pose, in the order of their first."""
        self._of_others: dict[float, Asker] = {}
        """Where those who never moved the camera would have it."""
        self._found: SessionBreach | None = None
        self._of_another: Asker | None = None
        """Who was first when an image showed somebody else's pose."""
        self._restarted = False

    def begin(self) -> None:
        """A client on each channel."""
        self.viewer.releases = False
        self.trial.peer.on_message = self._on_message
        self.trial.testee.ensure_running()
        self._begin()

    def _begin(self) -> None:
        for channel in CHANNELS:
            if self.knowledge.seats[channel]:
                self._connect(channel, 0)

    def choices(self, kind: str) -> Sequence[Step]:
        """The steps of a kind that may come next."""
        asking = [n for n, asker in self._askers.items() if not asker.half]
        reading = [n for n, reader in self._readers.items() if not reader.half]
        whole = [("msg", n) for n in asking] + [("ipc", n) for n in reading]
        half = [("msg", n) for n, asker in self._askers.items() if asker.half]
        half += [("ipc", n) for n, reader in self._readers.items() if reader.half]
        free = [
            (channel, n)
            for channel in CHANNELS
            for n in range(self.knowledge.seats[channel])
            if n not in self._seated(channel)
        ]
        lender = [n for n in reading if self.knowledge.frames]
        steps: dict[str, Callable[[], list[Step]]] = {
            "connect": lambda: [("connect", *seat) for seat in free],
            "ask": lambda: [
                ("ask", n, what) for n in asking for what in (VIEWPORT, *range(CAMERAS))
            ],
            "pose": lambda: [("pose", n, what) for n in asking for what in POSES],
            "hold": lambda: [("hold", n) for n in lender if not self._readers[n].keeps],
            "release": lambda: [("release", n) for n in lender if self._readers[n].keeps],
            "subscribe": lambda: [
                ("subscribe", n, *what)
                for n in lender
                if self.knowledge.subscribes
                for what in WANTED
            ],
            "half": lambda: [("half", *seat) for seat in whole],
            "complete": lambda: [("complete", *seat) for seat in half],
            "drop": lambda: [("drop", *seat, how) for seat in whole + half for how in ENDS],
            "stall": lambda: [("stall", seconds) for seconds in PAUSES],
            "look": lambda: [("look",)],
            "restart": lambda: (
                [("restart",)] if self.trial.testee.expendable and not self._restarted else []
            ),
        }
        return steps[kind]() if kind in steps else ()

    def take(self, step: Step) -> None:
        """Take a step."""
        kind, *arguments = step
        getattr(self, f"_{kind}")(*arguments)
        self._watch()

    def settle(self) -> None:
        """Look at everything once more, then end every connection; who comes next is served."""
        self._look()
        self._watch()
        self.leave()
        self._begin()
        self._look()
        self.leave()
        if self._counting and self.knowledge.crowd:
            served, before = 0, self.knowledge.crowd
            deadline = self.trial.peer.clock() + EFFECT_SECONDS
            while served < self.knowledge.crowd and self.trial.peer.clock() < deadline:
                served = crowd(self.trial)
            if served < self.knowledge.crowd:
                text = f"once all had left, {served} clients were lent frames, {before} before"
                raise SessionBreach("IMG-17", "leases-not-taken-back", text)

    def leave(self) -> None:
        """Close every connection."""
        for seated in map(self._seated, CHANNELS):
            for client in seated.values():
                forget(self.trial, client.connection)
        self._askers, self._readers, self._movers = {}, {}, []

    # Steps

    def _connect(self, channel: Channel, seat: int) -> None:
        if channel == "msg":
            self._askers[seat] = Asker(seat, self._dial(channel))
        else:
            self._readers[seat] = Reader(seat, self._dial(channel))
        connection = self._seated(channel)[seat].connection
        if not self.knowledge.greets:
            return
        deadline = self.trial.peer.clock() + EFFECT_SECONDS
        while not self._welcomed(connection):
            if self.trial.peer.clock() > deadline:
                # What has ended still takes a place, or the server greets nobody any more.
                lost = channel == "ipc" and self.knowledge.frames
                text = f"a new client on the {WORDS[channel]} channel was not served"
                raise SessionBreach("IMG-17" if lost else "CHN-14", "not-served", text)
            connection.close()
            self.trial.rest(0.02)
            connection = self._seated(channel)[seat].connection = self._dial(channel)

    def _welcomed(self, connection: Connection) -> bool:
        """Greet; whether there is a welcome, and images where there are some."""
        self.viewer.greet(connection)
        dealings = self.viewer.with_(connection)
        reads = connection.channel == "ipc" and self.knowledge.frames

        def served() -> bool:
            # With CUDA memory the init packet comes first (NEG-15), without it the welcome.
            return bool(dealings.welcome) and (bool(dealings.init_packets) or not reads)

        self.trial.wait(lambda: served() or connection.ended)
        return not connection.ended and bool(dealings.welcome) and not dealings.errors()

    def _ask(self, seat: int, what: int) -> None:
        asker = self._askers[seat]
        self.viewer.say(asker.connection, asker.request(what))

    def _pose(self, seat: int, kind: str) -> None:
        asker = self._askers[seat]
        where = next(self._numbers) / 1024.0
        self.viewer.say(asker.connection, camera_pose((where, 0.25, -4.0), kind=kind))
        if asker not in self._movers:
            self._movers.append(asker)
            # The order in which a server sees first poses is known once it has answered after each.
            self._ask(seat, VIEWPORT)
            self._answered(asker)
        if kind == "camera_pose":
            asker.camera = where
            if asker is not self._movers[0]:
                self._of_others[where] = asker

    def _hold(self, seat: int) -> None:
        self._readers[seat].keeps = True

    def _release(self, seat: int) -> None:
        reader = self._readers[seat]
        if reader.held is not None:
            self.viewer.release(reader.connection, reader.held)
        reader.held, reader.keeps = None, False

    def _subscribe(self, seat: int, *channels: str) -> None:
        message = {"type": "subscribe", "channels": list(channels)}
        self.viewer.say(self._readers[seat].connection, message)

    def _half(self, channel: Channel, seat: int) -> None:
        data = packet(encode(VIEWPORT_REQUEST))
        client = self._seated(channel)[seat]
        client.connection.send(data[:HALF])
        client.half = data[HALF:]

    def _complete(self, channel: Channel, seat: int) -> None:
        client = self._seated(channel)[seat]
        client.connection.send(client.half)
        client.half = b""
        if isinstance(client, Asker):
            client.asked.append(VIEWPORT)
        elif not client.keeps:
            self._release(seat)

    def _drop(self, channel: Channel, seat: int, how: str) -> None:
        connection = self._unseat(channel, seat)
        if how == "end":
            connection.end_stream()
            self.trial.wait(lambda: connection.ended, END_SECONDS)
        if how == "reset":
            connection.reset()
        forget(self.trial, connection)

    def _unseat(self, channel: Channel, seat: int) -> Connection:
        """Count a client no more; its connection."""
        client = self._seated(channel).pop(seat)
        if isinstance(client, Asker) and client in self._movers:
            self._movers.remove(client)
            if self._movers:
                now = self._movers[0]
                self._of_others = {w: a for w, a in self._of_others.items() if a is not now}
        return client.connection

    def _excuse(self) -> None:
        """A server that keeps few connections may end an older one for a further one (CHN-13),
        which may have come before it saw that another had gone.
        """
        for channel in CHANNELS:
            seated = [(seat, it.connection) for seat, it in self._seated(channel).items()]
            came = (it.number for it in self.trial.peer.connections if it.channel == channel)
            newest = max(came, default=0)
            for seat, connection in seated:
                replaced = connection.ended and connection.number < newest
                if replaced and self.knowledge.seats[channel] < SEATS:
                    forget(self.trial, self._unseat(channel, seat))

    def _stall(self, seconds: float) -> None:
        time.sleep(seconds)

    def _restart(self) -> None:
        self._restarted = True
        self.leave()
        self.trial.testee.stop()
        self.begin()

    # What must hold

    def _watch(self) -> None:
        """What must hold at any moment."""
        self.trial.rest(0.0)
        if self.trial.fate():
            raise SessionBreach("CHN-14", "ended", "the server ended")
        if self._found is not None:
            raise self._found
        if self._of_another is not None:
            first, self._of_another = self._of_another, None
            self.trial.rest(SETTLE_SECONDS)
            self._excuse()
            if first in self._movers[:1]:
                text = "an image shows the pose of a message client that was not first"
                raise SessionBreach("POS-11", "applied-without-control", text)
        for asker in self._askers.values():
            replies = self.trial.replies(asker.connection)
            if wrong := asker.wrong(replies, self.knowledge.cameras):
                raise SessionBreach("REQ-7", *wrong)

    def _look(self) -> None:
        """What must hold everywhere once time was given: replies to all, and images of the pose."""
        self._excuse()
        for seat, asker in self._askers.items():
            if not asker.half:
                self._ask(seat, VIEWPORT)
        for asker in list(self._askers.values()):
            if not asker.half:
                self._answered(asker)
        self._excuse()
        for reader in self._readers.values():
            if reader.connection.ended and not reader.half:
                text = f"IPC client {reader.seat} was disconnected"
                raise SessionBreach("CHN-14", "closes", text)
        if self.knowledge.frames:
            self._shown()

    def _answered(self, asker: Asker) -> None:
        connection = asker.connection
        self.trial.wait(
            lambda: len(self.trial.replies(connection)) >= len(asker.asked) or connection.ended
        )
        self._watch()
        self._excuse()
        if asker.seat not in self._askers:
            return
        if len(self.trial.replies(connection)) < len(asker.asked):
            how = "disconnected" if connection.ended else "not answered"
            code = "closes" if connection.ended else "no-reply"
            raise SessionBreach("CHN-14", code, f"message client {asker.seat} was {how}")

    def _shown(self) -> None:
        """Every client that can take a frame has one, and it shows the pose that counts."""
        self._excuse()
        free = [r for r in self._readers.values() if not (r.keeps or r.half)]
        mover = next(iter(self._movers), None)
        where = None if mover is None or mover.half else mover.camera

        def shown(reader: Reader) -> bool:
            return reader.frames > 0 and where in (None, reader.camera)

        deadline = self.trial.peer.clock() + EFFECT_SECONDS
        while not all(map(shown, free)) and self.trial.peer.clock() < deadline:
            if mover is not None and where is not None:
                pose = camera_pose((where, 0.25, -4.0))
                self.viewer.say(mover.connection, pose)
            self.trial.wait(lambda: all(map(shown, free)), RESEND_SECONDS)
            self._watch()
        behind = [reader for reader in free if not shown(reader)]
        if not behind:
            return
        if any(shown(r) for r in free) or not behind[0].frames:
            text = f"IPC client {behind[0].seat} is sent no newer frame, and holds none"
            raise SessionBreach("IMG-11" if len(behind) < len(free) else "CHN-14", "no-frame", text)
        seat = mover.seat if mover else None
        text = f"no image shows the pose of message client {seat}, first of all"
        raise SessionBreach("POS-11", "pose-not-shown", text)

    def _on_message(self, connection: Connection, arrived: Message) -> None:
        dealings = self.viewer.with_(connection)
        before = len(dealings.frames)
        self.viewer.on_message(connection, arrived)
        reader = next((r for r in self._readers.values() if r.connection is connection), None)
        if reader is not None and len(dealings.frames) > before:
            self._on_frame(reader, dealings.frames[-1])

    def _on_frame(self, reader: Reader, frame: Json) -> None:
        if reader.held is not None:
            text = f"IPC client {reader.seat} was sent a frame while it held another"
            self._found = self._found or SessionBreach("IMG-2", "another-frame", text)
        reader.show(frame)
        if reader.camera in self._of_others:
            self._of_another = next(iter(self._movers), None)
        if reader.keeps or reader.half:
            reader.held = frame
        else:
            self.viewer.release(reader.connection, frame)

    # Connections

    def _seated(self, channel: Channel) -> "dict[int, Asker] | dict[int, Reader]":
        return self._askers if channel == "msg" else self._readers

    def _dial(self, channel: Channel) -> Connection:
        connection = self.trial.reached(channel)
        if connection is None:
            text = f"no connection is accepted on the {channel} channel"
            raise SessionBreach("CHN-14", "not-listening", text)
        return connection


def numbers() -> Iterator[int]:
    """Numbers of poses."""
    return itertools.count(1)
