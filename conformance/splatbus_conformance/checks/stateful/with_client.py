"""A server's part in sessions with a client: it lends, announces anew, drops, refuses, stalls."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from splatbus_schemas import LIMITS

from splatbus_conformance.checks.stateful import SessionBreach, SessionOver, Step
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.pose_error import engine_of, off, read_pose
from splatbus_conformance.trials.scripted_server import ServedConnection
from splatbus_conformance.trials.trial import Violation
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.messages import encode, init_packet_1_1
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

NOWHERE = "splatbus-check-never-was"
RETURN_SECONDS: float = LIMITS["reconnect_max_seconds"] + 1.0
STALE_SECONDS, MOST_STALE = 0.005, 4
"""In which it shows that a connection was left by a process that was stopped; how many may be."""
HALF_A_PACKET = (64).to_bytes(4, "little") + b'{"type":"fra'
ENDS = ("close", "reset", "end", "cut")
"""How a connection is dropped: `end` is a half-close, `cut` comes in the midst of a packet."""
PAUSES = (0.005, 0.05)
STEPS: dict[str, tuple[Step, ...]] = {
    "lend": (("lend",),),
    "announce": (("announce", 1), ("announce", 2), ("announce", 4)),
    "mislead": (("mislead",),),
    "drop": tuple(("drop", which, how) for how in ENDS for which in ("ipc", "msg", "both")),
    "split": tuple(("split", seconds) for seconds in PAUSES),
    "stall": tuple(("stall", seconds) for seconds in PAUSES),
    "refuse": tuple(("refuse", which, 0.2) for which in ("ipc", "msg", "both")),
    "pose": (("pose",),),
    "restart": (("restart",),),
}
"""Every step. `announce` is a further init packet, of images smaller by so much; `mislead` one of
memory that is not there; `split` is a frame in two pieces."""


class WithClient:
    """The server's part in one session.

    Args:
        trial: with the client.
        size: of the images that are announced first, in pixels.
        returning: how it returns after the last step is looked at too.
    """

    def __init__(self, trial: ClientTrial, size: tuple[int, int], returning: bool) -> None:
        self.trial, self.role, self.facts = trial, trial.role, trial.facts
        self._size, self._returning = size, returning
        self._at: dict[Channel, Connection] = {}
        self._channels: list[Channel] = sorted(trial.facts.returns)
        self._misled = False
        """The memory that was announced last is not there."""
        self._lost = False
        """A connection has been lost in this session."""
        self._restarted = False
        self._poses = 0
        self._lent: Counter[tuple[int, int]] = Counter()
        """Generation and number of each frame, on this IPC connection."""

    def begin(self) -> None:
        """Meet the client on connections that no session has used."""
        if not self._channels:
            self.trial.not_observable("the testee does not connect again")
        self.role.lends_frames = False
        self._meet_on(self._channels)
        self._watch()

    def choices(self, kind: str) -> Sequence[Step]:
        """The steps of a kind that may come next."""
        able = self.facts.capabilities()
        reads = "ipc" in self._channels and self.facts.opens
        if kind in ("drop", "refuse"):
            both = len(self._channels) == 2
            return [s for s in STEPS[kind] if (both if s[1] == "both" else s[1] in self._channels)]
        possible = {
            "lend": reads and "frames" in able and not self._misled,
            "split": reads and "frames" in able and not self._misled,
            "announce": reads and "reinit" in able,
            "mislead": reads and "reinit" in able and not self._misled,
            "stall": True,
            "pose": "msg" in self._channels and self.facts.lacks("adapter:send_camera") is None,
            "restart": self.trial.testee.expendable and not self._restarted,
        }
        return STEPS[kind] if possible.get(kind) else ()

    def take(self, step: Step) -> None:
        """Take a step."""
        kind, *arguments = step
        getattr(self, f"_{kind}")(*arguments)
        self._watch()

    def settle(self) -> None:
        """Wait for every answer that is due, then close both connections."""
        self._rest()
        self._watch()
        for channel in self._channels:
            self._end(channel, "close")
        if self._returning:
            counts = {channel: self._count(channel) for channel in self._channels}
            missing = [c for c in self._channels if not self._arrives(c, counts[c])]
            self._judge_return(missing)

    def leave(self) -> None:
        """Close every connection."""
        self.trial.peer.close_all()

    # Steps

    def _lend(self, pause: float = 0.0) -> None:
        """Lend a frame, once the one before has come back; in two pieces if there is a pause."""
        self._answered()
        self._released()
        generation, connection = self._dealings.generation, self._at["ipc"]
        lent = packet(encode(self.role.next_frame(connection)))
        self._lent[generation, self._dealings.frames[-1]] += 1
        half = len(lent) // 2 if pause else len(lent)
        connection.send(lent[:half])
        if pause:
            self.trial.rest(pause)
            connection.send(lent[half:])

    _split = _lend

    def _stall(self, seconds: float) -> None:
        time.sleep(seconds)

    def _announce(self, part: int) -> None:
        self.role.width, self.role.height = (max(1, length // part) for length in self._size)
        self._misled = False
        self.role.offer(self._at["ipc"])

    def _mislead(self) -> None:
        generation = int(self.role.init_packet(self._at["ipc"])["generation"])
        self._misled = True
        self.role.offer(self._at["ipc"], init_packet_1_1(NOWHERE, generation))

    def _drop(self, which: str, how: str) -> None:
        dropped = self._named(which)
        for channel in dropped:
            self._end(channel, how)
        self._return(dropped)

    def _refuse(self, which: str, seconds: float) -> None:
        refused = self._named(which)
        for channel in refused:
            self.trial.peer.refuse(channel)
            self._end(channel, "reset")
        self.trial.rest(seconds)
        for channel in refused:
            self.trial.peer.listen(channel)
        self._return(refused)

    def _restart(self) -> None:
        self._restarted = True
        self.trial.end_testee()
        for channel in self._channels:
            self._end(channel, "close")
        self._meet_on(self._channels)

    def _pose(self) -> None:
        """Move the engine's camera; the pose has to come, and be the right one (CNV-1)."""
        self._poses += 1
        position, rotation = (float(self._poses), 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        try:
            self.trial.ask("send_camera", position=list(position), rotation=list(rotation))
        except Violation as violation:
            raise SessionBreach("CHN-19", violation.code, str(violation)) from None
        engine = engine_of(self.trial.greeting, "camera_pose")
        right = engine.position_to_wire(position), engine.quaternion_to_wire(rotation)
        heard = self.role.with_(self._at["msg"]).heard
        single, size = self.trial.greeting.single, self._size

        def came() -> bool:
            sent = [m for m in heard if m.get("type") == "camera_pose"]
            pose = read_pose(sent[-1]) if sent else None
            return pose is not None and not off(pose, *right, single=single, size=size).far

        if not self.trial.wait(lambda: came() or self._at["msg"].ended):
            text = "the pose that its engine was given"
            if any(m.get("type") == "camera_pose" for m in heard):
                raise SessionBreach("CNV-1", "another-pose", f"{text} became another")
            raise SessionBreach("CHN-19", "pose-not-sent", f"{text} never came")

    # What must hold

    def _watch(self) -> None:
        """What must hold at any moment."""
        self.trial.rest(0.0)
        self._lives("CHN-19" if self._lost else "OPN-1")
        if "ipc" in self._at:
            self._nothing_twice()
            if self._at["ipc"].ended:
                raise SessionBreach(
                    "CHN-10", "closes", "it closed the IPC connection, though nothing was wrong"
                )
        if "msg" in self._at and self._at["msg"].ended:
            self._return(["msg"])

    def _lives(self, requirement: str) -> None:
        fate = self.trial.fate()
        if fate == "exits":
            raise SessionOver
        if fate:
            raise SessionBreach(requirement, "dies", "the testee died")

    def _nothing_twice(self) -> None:
        dealings = self._dealings
        for kind, said, requirement, code in (
            ("answers", self._said("opened", "open_failed"), "OPN-1", "answered-twice"),
            ("closed", self._said("closed"), "OPN-5", "closed-too-often"),
        ):
            for generation, times in said.items():
                if times > 1:
                    text = f"generation {generation} got {times} {kind}"
                    raise SessionBreach(requirement, code, text)
        if dealings.generation in self._said("closed"):
            raise SessionBreach(
                "OPN-5",
                "closed-the-newest",
                f"it closed generation {dealings.generation}, the newest",
            )
        for image, times in self._releases().items():
            if times > self._lent[image]:
                text = f"frame {image[1]} of generation {image[0]} was released {times} times"
                raise SessionBreach(
                    "IMG-12", "released-too-often", f"{text} and lent {self._lent[image]} times"
                )

    def _rest(self) -> None:
        """What must hold once nothing more comes."""
        if "ipc" not in self._at or not self.facts.opens:
            return
        self._answered()
        newest, announced = self._dealings.generation, set(self._dealings.generations)
        self._until(lambda: set(self._said("opened", "open_failed")) >= announced)
        unanswered = announced - set(self._said("opened", "open_failed"))
        if unanswered:
            raise SessionBreach("OPN-1", "no-reply", f"no answer to generation {min(unanswered)}")
        self._released()
        former = set(self._said("opened")) - {newest}
        self._until(lambda: former <= set(self._said("closed")))
        if still := former - set(self._said("closed")):
            raise SessionBreach(
                "OPN-5", "not-closed", f"generation {min(still)} was not closed after {newest} came"
            )

    def _answered(self) -> None:
        """The newest init packet has been answered, and rightly."""
        dealings, newest = self._dealings, self._dealings.generation
        self._until(lambda: newest in dealings.opened | dealings.failed)
        if newest not in dealings.opened | dealings.failed:
            raise SessionBreach("OPN-1", "no-reply", f"no answer to generation {newest}")
        if self._misled and newest in dealings.opened:
            raise SessionBreach(
                "OPN-2",
                "opened-missing-memory",
                "it said that it had opened memory that does not exist",
            )
        if not self._misled and newest in dealings.failed:
            first = "CHN-24" if len(dealings.generations) == 1 else "OPN-5"
            raise SessionBreach(
                first,
                "open-failed",
                f"good memory, generation {newest}, was answered with open_failed",
            )

    def _released(self) -> None:
        """Every frame has come back."""
        self._until(lambda: len(self._releases()) >= len(self._lent))
        if held := self._lent - self._releases():
            generation, seq = min(held)
            raise SessionBreach(
                "IMG-12", "not-released", f"frame {seq} of generation {generation} was not released"
            )

    # Losing connections, and what comes back

    def _end(self, channel: Channel, how: str) -> None:
        connection, self._lost = self._at[channel], True
        if channel == "ipc":  # as a server that was started again: with its own size
            self.role.width, self.role.height = self._size
        if how == "end":
            connection.end_stream()
            if not self.trial.ends(connection):
                raise SessionBreach(
                    "CHN-17", "not-closed", f"it kept the {channel} connection after its end"
                )
        if how == "cut":
            connection.send(HALF_A_PACKET)
        if how == "reset":
            connection.reset()
        connection.close()

    def _return(self, dropped: Iterable[Channel]) -> None:
        """Wait until it is back on these channels; on others too that it has closed itself."""
        back = [c for c in self._channels if c in dropped or self._at[c].ended]
        self._judge_return([c for c in back if not self._arrives(c, self._count(c) - self._new(c))])
        self._meet_on(back)

    def _judge_return(self, missing: Sequence[Channel]) -> None:
        self._lives("CHN-19")
        if not missing:
            return
        if set(missing) == set(self._channels):
            raise SessionBreach("CHN-19", "hangs", "the testee neither reacted nor went on")
        raise SessionBreach(
            "CHN-20", "no-reconnect", f"it did not connect to the {missing[0]} channel again"
        )

    def _meet_on(self, channels: Iterable[Channel]) -> None:
        """Take connections that are new, and let the testee say what it says first."""
        for channel in channels:
            self._at[channel] = self._new_connection(channel)
        for channel in channels:
            connection = self._at[channel]
            dealings = self.role.with_(connection)
            self._greeted(channel, connection, dealings)
            if channel == "ipc":
                self._lent.clear()
                self._misled = False
                if self.facts.opens:
                    self._answered()

    def _new_connection(self, channel: Channel) -> Connection:
        for _ in range(MOST_STALE):
            connection = self.trial.connection(channel)
            self.trial.rest(STALE_SECONDS)
            if not connection.ended:
                break
        return connection

    def _greeted(
        self, channel: Channel, connection: Connection, dealings: ServedConnection
    ) -> None:
        if self.facts.speaks_1_1(channel):
            came = self.trial.wait(lambda: dealings.welcome or connection.ended)
        elif channel == "msg" and self.facts.asks:
            came = self.trial.wait(lambda: connection.messages or connection.ended)
        else:
            return
        if not came or connection.ended:
            raise SessionBreach(
                "CHN-19",
                "did-not-go-on",
                f"it came to the {channel} channel, and did not go on there",
            )

    def _arrives(self, channel: Channel, before: int) -> bool:
        seconds = self.trial.return_seconds() if self.facts.away_seconds else RETURN_SECONDS
        return self.trial.arrives(channel, seconds, before)

    # What was said

    def _named(self, which: str) -> list[Channel]:
        return [c for c in self._channels if which in ("both", c)]

    def _count(self, channel: Channel) -> int:
        return sum(c.channel == channel for c in self.trial.peer.connections)

    def _new(self, channel: Channel) -> int:
        """How many connections came after the one that this session has."""
        on_it = [c for c in self.trial.peer.connections if c.channel == channel]
        return len(on_it) - 1 - on_it.index(self._at[channel])

    def _until(self, condition: Callable[[], bool]) -> None:
        self.trial.wait(lambda: condition() or self._at["ipc"].ended)
        if self._at["ipc"].ended:
            self._watch()

    @property
    def _dealings(self) -> ServedConnection:
        return self.role.with_(self._at["ipc"])

    def _said(self, *kinds: str) -> Counter[int]:
        """How often each generation was named in messages of these kinds."""
        named = (whole(m.get("generation")) for m in self._dealings.heard if m.get("type") in kinds)
        return Counter(generation for generation in named if generation is not None)

    def _releases(self) -> Counter[tuple[int, int]]:
        said = (m for m in self._dealings.heard if m.get("type") == "release")
        named = ((whole(m.get("generation")), whole(m.get("seq"))) for m in said)
        return Counter((g, seq) for g, seq in named if g is not None and seq is not None)
