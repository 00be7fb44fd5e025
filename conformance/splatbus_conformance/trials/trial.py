"""A trial: one check's dealings with the testee, whichever side that is, and its judgement."""

import itertools
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence, Sized
from typing import Any, Literal, NamedTuple, NoReturn, TypeVar

from hypothesis.strategies import SearchStrategy
from splatbus_schemas import LIMITS
from splatbus_schemas.requirements import Requirement

from splatbus_conformance.cases.drawing import climb, draw
from splatbus_conformance.cases.script import Case, Rows
from splatbus_conformance.images.memory.cuda_stand_in.session import StandIn
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.pictures import Picture
from splatbus_conformance.measurements import Measurements
from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.sockets import Connection, Peer

T = TypeVar("T")
Place = Channel | Literal["host", "device", "calls"]
"""A channel, or the memory in which images are: `calls` is that of a device too, where its use is
seen by the calls of the stand-in CUDA runtime.
"""
JITTER_SECONDS = 0.03
"""How much closer two events may look than they were, since the harness sees them late."""
SETTLE_SECONDS = 0.05
"""Time for what was sent last to be understood; a client that is cut off before that backs off."""
EFFECT_SECONDS: float = LIMITS["close_seconds"]
"""How long a check waits for an effect; the time that spec 1.0 section 1.2 gives a close."""
THOROUGH = ("full", "soak")
"""Profiles that take their time."""
BRIEFLY = 4
ENDING_SECONDS = 0.3
"""How long after its sockets a process may end, and still be said to have ended, not closed."""
ENDED_SECONDS = 0.02
"""Until what a testee that has ended still asked for is seen."""
GLANCE_SECONDS = 0.02
"""How often a check looks at what it can only ask for."""
REACTION_SECONDS = 0.2
"""How long a check listens for what need not come."""


class LostSign(NamedTuple):
    """A vital sign that the testee has lost, as a check has come upon it."""

    what: str
    before: Channel | None
    """Where it was gone when the check began: the last in which this channel was alive took it."""
    entries: list[Entry]
    """What had crossed the wire in the check when it was missed."""


class Violation(AssertionError):  # noqa: N818 - a finding, no error of ours
    """The testee did what the requirement does not accept; the message says what."""

    def __init__(self, code: str, what: str) -> None:
        super().__init__(what)
        self.code = code
        """Which of the ways to break it this is, for whoever looks for this one."""


class NotObservable(BaseException):
    """Nothing can be said of this testee; the message says why. A search does not take it for a
    failure.
    """


class Stand(NamedTuple):
    """What stays from one check to the next."""

    peer: Peer
    testee: Testee
    patience: float
    stand_in: StandIn | None = None
    device: Device | None = None


class Trial:
    """What every check has in hand: the raw peer, the testee, and the judgement."""

    def __init__(self, requirement: Requirement, stand: Stand) -> None:
        self.requirement = requirement
        self.peer, self.testee, self.patience, self.stand_in, self.device = stand
        self.delivered = 0
        """Cases that were delivered and followed by something that proves it."""
        self.controls = 0
        """Good things that the testee was seen to take behind what was delivered."""
        self.extent = ""
        """How far a check of a limit has come, for whoever reads that it passed."""
        self.purpose = requirement.id
        """What the check does, for whoever has to start the testee for it."""
        self.losses: list[LostSign] = []
        self.killed = False
        """The check has ended the testee's process itself, as its scenario demands."""
        self.measurements = Measurements()
        self.seed = 0
        self.profile = "quick"
        self.script: Rows | None = None
        """The cases to deliver, where they are not the check's own choice."""
        self.left_out = 0
        """Listed cases that this run left for another seed, or for the full profile."""
        self.went_through: list[list[Case]] = []
        """Every case that was begun, for each time that the check went through some."""
        self.simpler: list[Callable[[Any], Iterable[Any]]] = []
        """For each time, what makes a drawn case simpler."""
        self.unseen: dict[Place | None, str] = {}
        """Why nothing can be said of a place, of a check that is tried at several."""
        self._going_through = False
        self.before_last_case = 0
        """How many entries were on record when the last case was begun."""
        self.peer.clear()

    @property
    def thorough(self) -> bool:
        """The run takes its time."""
        return self.profile in THOROUGH

    @property
    def stride(self) -> int:
        """This profile delivers one case of so many."""
        return BRIEFLY if self.profile == "brief" else 1

    def share(self, count: int) -> int:
        """How many of so many cases this profile delivers."""
        return -(-count // self.stride)

    def each(
        self,
        listed: Iterable[T] = (),
        drawn: SearchStrategy[T] | None = None,
        *,
        kind: Callable[[T], Hashable] | None = None,
        spare: int | None = None,
        quick: int = 0,
        full: int = 0,
        simpler: Callable[[T], Iterable[T]] = lambda case: (),
        search: str = "",
    ) -> Iterator[T]:
        """Go through cases: those listed, then so many that Hypothesis draws in each profile.

        What breaks a requirement can be delivered again, since each case that is begun is noted.
        One loop at a time: a case that belongs to an outer one would not be known.

        Args:
            listed: cases that are always the same.
            drawn: what to draw from; the same seed draws the same cases.
            kind: what a listed case is one of. Of each kind the quick profile always delivers one,
                which the seed chooses; extreme values have kinds of their own. Without it every
                case is one of a kind, and always delivered.
            spare: how many more of the listed cases the quick profile delivers at most; all that
                the testee affords if not given. What is left out is counted.
            quick: how many to draw in the quick profile.
            full: how many to draw in the full one.
            simpler: what makes a drawn case simpler, and leaves it a case.
            search: if given, half of the cases that the full profile draws climb towards the
                largest errors of what `measured` is told to have a budget; another word draws
                other cases.
        """
        assert not self._going_through, "a check goes through cases while it goes through cases"
        number = len(self.went_through)
        noted: list[Case] = []
        self.went_through.append(noted)
        self.simpler.append(simpler)
        self._going_through = True
        try:
            if self.script is not None:
                chosen = self._scripted(number, list(listed))
            else:
                count = self.share(full if self.thorough else quick)
                known = list(listed)
                places = self._places(known, kind, spare)
                chosen = itertools.chain(
                    self._listed(known, *places), self._drawn(drawn, count, search)
                )
            for case, value in chosen:
                noted.append(case)
                self.before_last_case = len(self.peer.entries)
                yield value
        finally:
            self._going_through = False

    @property
    def number(self) -> int:
        """Of the case that was begun last: how many came before it."""
        return len(self.went_through[-1]) - 1

    def note(self, case: Any) -> None:
        """Note a case that the check makes up as it goes; it joins those of its last loop."""
        self.went_through[-1].append(Case(True, case))

    def affords(self) -> bool:
        """Whether there is time for a case that need not be delivered."""
        return True

    def _scripted(self, number: int, known: Sequence[T]) -> Iterator[tuple[Case, T]]:
        assert self.script is not None
        for case in self.script[number] if number < len(self.script) else ():
            if case.drawn or case.value < len(known):
                yield case, case.value if case.drawn else known[case.value]

    def _places(
        self, known: Sequence[T], kind: Callable[[T], Hashable] | None, spare: int | None
    ) -> tuple[list[int], list[int]]:
        """Of listed cases, which are delivered in any case, and which if there is time."""
        everything = range(len(known))
        if self.thorough or kind is None:
            return list(everything[:: self.stride]), []
        kinds: dict[Hashable, list[int]] = {}
        for place in everything:
            kinds.setdefault(kind(known[place]), []).append(place)
        one_of_each = sorted(of[self.seed % len(of)] for of in kinds.values())[:: self.stride]
        others = sorted(set(everything) - set(one_of_each))
        begin = self.seed % len(others) if others else 0
        others = others[begin:] + others[:begin]
        return one_of_each, others[: self.share(len(others) if spare is None else spare)]

    def _listed(
        self, known: Sequence[T], needed: Sequence[int], spare: Sequence[int]
    ) -> Iterator[tuple[Case, T]]:
        self.left_out += len(known) - len(needed)
        for place in needed:
            yield Case(False, place), known[place]
        for place in spare:
            if not self.affords():
                break
            self.left_out -= 1
            yield Case(False, place), known[place]

    def _drawn(
        self, drawn: SearchStrategy[T] | None, count: int, search: str
    ) -> Iterator[tuple[Case, T]]:
        if drawn is None:
            return
        if not search or not self.thorough:  # so few cases reach farther at random
            cases: Iterable[T] = draw(drawn, count, self.seed)
        else:
            self.measurements.newest()  # of cases before these
            cases = climb(drawn, count, f"{search} {self.seed}", self.measurements.newest)
        for number, value in enumerate(cases):
            if number == 0 or self.affords():
                yield Case(True, value), value

    def wait(self, condition: Callable[[], Any], seconds: float = EFFECT_SECONDS) -> bool:
        """Wait until the condition holds or the testee's process has ended; whether it holds."""
        self.peer.until(lambda: condition() or self.testee.ended(), seconds)
        return bool(condition())

    def ends(self, connection: Connection, seconds: float = EFFECT_SECONDS) -> bool:
        """Whether the testee ends this connection in time."""
        return self.wait(lambda: connection.ended, seconds)

    def grows(self, connection: Connection, things: Sized, after: int = 0, *seconds: float) -> bool:
        """Whether there are more than so many of the things that come on a connection, in time."""
        self.wait(lambda: len(things) > after or connection.ended, *seconds)
        return len(things) > after

    def outcome_on_ipc(self, connection: Connection, *scripts: bytes) -> str:
        """What becomes of scripts on an IPC connection."""
        raise NotImplementedError

    def outcome_on_msg(self, connection: Connection, *scripts: bytes) -> str:
        """What becomes of scripts on a message connection."""
        raise NotImplementedError

    def outcome(self, connection: Connection, *scripts: bytes) -> str:
        """What becomes of scripts on a connection of either channel, by that channel's control."""
        by = self.outcome_on_ipc if connection.channel == "ipc" else self.outcome_on_msg
        return by(connection, *scripts)

    def pictures(self) -> tuple[Picture, ...]:
        """Of the last image that was judged, if there is one."""
        return ()

    def rest(self, seconds: float) -> None:
        """Let time pass, and handle what happens in it."""
        self.peer.pump(seconds)

    def end_testee(self) -> None:
        """End the testee; nothing that it had begun is taken for its successor's."""
        self.testee.stop()
        if self.testee.expendable:
            self.rest(ENDED_SECONDS)
            self.peer.close_all()

    def fate(self) -> str | None:
        """`dies` or `exits` if the testee's process has ended, else None."""
        ended = self.testee.ended()
        if ended is None:
            return None
        return "dies" if ended.crashed else "exits"

    def measured(
        self, quantity: str, error: float, budget: float | None, unit: str, input: str
    ) -> None:
        """Note the error of one case; the worst of each quantity reaches the reports."""
        self.measurements.add(quantity, error, budget, unit, input)

    def expect_within_budgets(self) -> None:
        """The requirement is violated if anything that was measured passed its budget."""
        if beyond := self.measurements.beyond():
            others = [it for it in self.measurements if it not in beyond]
            told = [f"{it}, {it.beyond} of them beyond the budget" for it in beyond]
            self.violated("beyond-its-budget", "; ".join([*told, *map(str, others)]))

    def judge(self, outcome: str, what: str) -> None:
        """Compare an outcome with those that the specification accepts for this requirement."""
        acceptable = self.requirement.acceptable
        if outcome == "closes" and outcome not in acceptable:
            self.wait(self.fate, ENDING_SECONDS)
            outcome = self.fate() or outcome
        if outcome == "hangs":
            outcome = self.fate() or outcome
        if outcome not in acceptable:
            self.violated(outcome, f"{what}: the testee {OUTCOME_WORDS.get(outcome, outcome)}")

    def expect(self, holds: object, code: str, what: str) -> None:
        """The requirement is violated unless `holds`; `what` says what was seen instead, and the
        code which of the ways to break it that is.
        """
        if not holds:
            self.violated(code, what)

    def violated(self, code: str, what: str) -> NoReturn:
        """The requirement is violated, in the way that has this code; `dies`, if the testee's
        process has crashed, whatever of it was seen first.
        """
        if ended := self.testee.ended():
            what += f"; its process {ended}"
            code = "dies" if ended.crashed and not self.killed else code
        raise Violation(code, what)

    def not_observable(self, reason: str) -> NoReturn:
        """Nothing can be said: skip, with the reason."""
        if ended := self.testee.ended():
            reason += f"; its process {ended}"
        raise NotObservable(reason)


OUTCOME_WORDS = {
    "accepts": "took it as valid",
    "applies": "applied it",
    "closes": "closed the connection",
    "declines": "answered open_failed",
    "dies": "died",
    "exits": "exited",
    "hangs": "neither reacted nor went on",
    "ignores": "ignored it and went on",
    "keeps": "kept its state",
    "reconnects": "connected again",
    "replies": "replied to it",
    "reports": "answered with an error",
    "refuses": "answered open_failed to the good init packet that followed",
    "waits": "waited",
}
