"""Checks: each plays one scenario with the testee and judges one requirement by it.

A check is a function `check_*` of a `Trial`, and, where it says so, of the channel that it is tried
on, of what is set up for it, and of one case of many. Its docstring is what `explain` shows. The
set of outcomes that it accepts is the one that the specification lists for its requirement.
"""

import functools
from collections.abc import Callable, Hashable, Iterable, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from hypothesis.strategies import SearchStrategy

from splatbus_conformance.plan import Side
from splatbus_conformance.trials.trial import NotObservable
from splatbus_conformance.wire.recording import Channel

DECLARES_HOST_MEMORY = ("hello:ipc", "capability:host_shm")
OPENS_HOST_MEMORY = (*DECLARES_HOST_MEMORY, "opens")
"""What a check needs that shows by opened memory that the testee goes on."""
Needs = tuple[str, ...]


class End(NamedTuple):
    """Whom a check judges, and where."""

    side: Side
    channel: Channel


_SIDES: dict[str, Side] = {"ClientTrial": "client", "ServerTrial": "server"}
"""Which side a check judges that names no ends, by what its trial is."""
CLIENT_IPC, CLIENT_MSG = End("client", "ipc"), End("client", "msg")
SERVER_IPC, SERVER_MSG = End("server", "ipc"), End("server", "msg")


class Facts(Protocol):
    """What the testee has shown of itself."""

    def lacks(self, need: str) -> str | None:
        """Why something that a check needs is not there; None if it is."""


class Cases(NamedTuple):
    """What a check goes through, one after the other: as `Trial.each` has it."""

    listed: Iterable[Any] = ()
    drawn: SearchStrategy[Any] | None = None
    kind: Callable[[Any], Hashable] | None = None
    spare: int | None = None
    quick: int = 0
    full: int = 0
    simpler: Callable[[Any], Iterable[Any]] = lambda case: ()
    search: str = ""


Choice = Cases | Callable[..., Cases]
"""Cases, or what chooses them for a trial, its channel if the check takes one, and its setting."""


@dataclass(frozen=True)
class Check:
    """What is known of a check of one side before it runs."""

    requirement: str
    observable: str
    """What of the requirement can be seen from outside."""
    places: Mapping[Channel | None, Needs]
    """What the testee must have shown of itself, on each channel that the check is tried on, or
    at all: as `ClientFacts.lacks` and `ServerFacts.lacks` know it."""
    may_crash: bool
    """It can end a testee that breaks the requirement: only with --launch or --allow-crash."""
    profile: str
    """The shortest that runs it: `brief`, or `quick` or `full` for what takes long."""
    side: Side = "client"
    play: Callable[[Any], None] = lambda trial: None
    """The scenario, of a trial of that side."""

    @property
    def name(self) -> str:
        """By which it is selected, and told."""
        return self.play.__name__

    @property
    def does(self) -> str:
        """What it does, in a sentence or two."""
        return paragraph(self.play.__doc__)

    @property
    def needs(self) -> frozenset[str]:
        """Whatever it needs anywhere."""
        return frozenset().union(*self.places.values())

    @property
    def level(self) -> str:
        """The assurance of its verdict."""
        if {"device", "stand-in", "pixels"} & self.needs:
            return "L3"
        return "L2" if any(need.startswith("adapter:") for need in self.needs) else "L1"

    def lacks(self, facts: Facts) -> str | None:
        """Why it can be tried on no channel with this testee; None if it can."""
        reasons = list(self.shown_on(facts).values())
        return None if None in reasons else reasons[0]

    def shown_on(self, facts: Facts) -> dict[Channel | None, str | None]:
        """Of each channel, why the testee has not shown all that the check needs there, if so."""
        return {
            channel: next(filter(None, map(facts.lacks, needs)), None)
            for channel, needs in self.places.items()
        }


def check(
    requirement: str,
    *,
    observable: str,
    needs: Needs = (),
    on: Mapping[End, Needs] | None = None,
    given: Callable[..., AbstractContextManager[Any]] | None = None,
    cases: Choice | Mapping[End, Choice] | None = None,
    may_crash: bool = False,
    profile: str = "brief",
) -> Callable[[Callable[..., None]], Callable[[Any], None]]:
    """Declare a function to be the check of a requirement.

    Args:
        requirement: its id.
        observable: what of the requirement is seen.
        needs: what the testee must have shown, where the check is of one side, that of its trial.
        on: the same for each end at which it judges; then the function takes a channel, too.
        given: what sets up, once for all cases, what the function takes next, and ends it; it is
            given the trial and the channel. What is to be judged when all is over, it judges.
        cases: what to go through, at each of these ends; then the function takes one case, too.
        may_crash: as of a `Check`.
        profile: as of a `Check`.
    """

    def declare(function: Callable[..., None]) -> Callable[[Any], None]:
        def play(trial: Any) -> None:
            shown = found[trial.side].shown_on(trial.facts)
            for channel, why_not in shown.items() if on else [(None, None)]:
                try:
                    if why_not:
                        raise NotObservable(why_not)
                    _through(function, trial, channel, given, cases)
                except NotObservable as nothing:
                    if channel is None or {*trial.unseen, channel} == shown.keys():
                        raise
                    trial.unseen[channel] = str(nothing)

        functools.update_wrapper(play, function, updated=())
        del play.__wrapped__  # type: ignore[attr-defined]  # whoever collects it gives it a trial
        found: dict[Side, Check] = {}
        for side, places in _sides(function, needs, on).items():
            found[side] = Check(requirement, observable, places, may_crash, profile, side, play)
        play.checks = found  # type: ignore[attr-defined]
        return play

    return declare


def _through(
    function: Callable[..., None],
    trial: Any,
    channel: Channel | None,
    given: Callable[..., AbstractContextManager[Any]] | None,
    cases: Choice | Mapping[End, Choice] | None,
) -> None:
    arguments = [trial] if channel is None else [trial, channel]
    with ExitStack() as held:
        if given:
            arguments.append(held.enter_context(given(*arguments)))
        if cases is None:
            function(*arguments)
            return
        chosen = cases
        if isinstance(chosen, Mapping):
            assert channel, "cases of each end, of a check that names no end"
            chosen = chosen[End(trial.side, channel)]
        if not isinstance(chosen, Cases):
            chosen = chosen(*arguments)
        for case in trial.each(**chosen._asdict()):
            function(*arguments, case)


def _sides(
    function: Callable[..., None], needs: Needs, on: Mapping[End, Needs] | None
) -> dict[Side, dict[Channel | None, Needs]]:
    if on is None:
        return {_SIDES[function.__annotations__["trial"].__name__]: {None: needs}}
    sides: dict[Side, dict[Channel | None, Needs]] = {}
    for end, needed in on.items():
        sides.setdefault(end.side, {})[end.channel] = needed
    return sides


def paragraph(docstring: str | None) -> str:
    """A docstring on one line."""
    return " ".join((docstring or "").split())
