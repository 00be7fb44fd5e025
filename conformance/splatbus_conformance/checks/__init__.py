"""Checks: each plays one scenario with the testee and judges one requirement by it.

A check is a function `check_*` of a `Trial`, and, where it says so, of the place where it is tried,
of what is set up for it, and of one case of many. Whenever it returns, a case was delivered and
seen to be taken; it returns False where nothing shows that. Its docstring is what `explain` shows.
The set of outcomes that it accepts is the one that the specification lists for its requirement.
"""

import functools
from collections.abc import Callable, Hashable, Iterable, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from hypothesis.strategies import SearchStrategy

from splatbus_conformance.plan import Side
from splatbus_conformance.trials.trial import NotObservable
from splatbus_conformance.trials.trial import Place as Place

DECLARES_HOST_MEMORY = ("hello:ipc", "capability:host_shm")
OPENS_HOST_MEMORY = (*DECLARES_HOST_MEMORY, "opens")
"""What a check needs that shows by opened memory that the testee goes on."""
Needs = tuple[str, ...]


class End(NamedTuple):
    """Whom a check judges, and where: at one place, or wherever its scenario goes."""

    side: Side
    place: Place | None = None


CLIENT, SERVER = End("client"), End("server")
CLIENT_HOST, CLIENT_DEVICE = End("client", "host"), End("client", "device")
CLIENT_CALLS = End("client", "calls")
SERVER_HOST, SERVER_DEVICE = End("server", "host"), End("server", "device")
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
"""Cases, or what chooses them for a trial, its place if the check takes one, and its setting."""


@dataclass(frozen=True)
class Check:
    """What is known of a check of one side before it runs."""

    requirement: str
    places: Mapping[Place | None, Needs]
    """What the testee must have shown of itself, for each place where the check is tried, or at
    all: as `ClientFacts.lacks` and `ServerFacts.lacks` know it."""
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
        """The assurance of its verdict: the least that a place of it asks for."""
        return min(map(_level, self.places.values()))

    def lacks(self, facts: Facts) -> str | None:
        """Why it can be tried nowhere with this testee; None if it can."""
        reasons = list(self.shown_at(facts).values())
        return None if None in reasons else reasons[0]

    def shown_at(self, facts: Facts) -> dict[Place | None, str | None]:
        """Of each place, why the testee has not shown all that the check needs there, if so."""
        return {
            place: next(filter(None, map(facts.lacks, needs)), None)
            for place, needs in self.places.items()
        }


def _level(needs: Needs) -> str:
    if {"device", "stand-in", "pixels"} & {*needs}:
        return "L3"
    return "L2" if any(need.startswith("adapter:") for need in needs) else "L1"


def check(
    requirement: str,
    *,
    on: Mapping[End, Needs],
    given: Callable[..., Any] | None = None,
    cases: Choice | Mapping[End, Choice] | None = None,
    may_crash: bool = False,
    profile: str = "brief",
) -> Callable[[Callable[..., bool | None]], Callable[[Any], None]]:
    """Declare a function to be the check of a requirement.

    Args:
        requirement: its id.
        on: what the testee must have shown, for each end at which the check judges; where they
            are places, the function takes one, too.
        given: what sets up, once for all cases, what the function takes next; it is given the trial
            and the place. Of a context the end belongs to it, and what is judged when all is
            over.
        cases: what to go through, at each of these ends; then the function takes one case, too.
        may_crash: as of a `Check`.
        profile: as of a `Check`.
    """

    sides: dict[Side, dict[Place | None, Needs]] = {}
    for end, needs in on.items():
        sides.setdefault(end.side, {})[end.place] = needs

    def declare(function: Callable[..., bool | None]) -> Callable[[Any], None]:
        def play(trial: Any) -> None:
            shown = found[trial.side].shown_at(trial.facts)
            for place, why_not in shown.items():
                try:
                    if why_not:
                        raise NotObservable(why_not)
                    _through(function, trial, End(trial.side, place), given, cases)
                except NotObservable as nothing:
                    trial.unseen[place] = str(nothing)
            if trial.unseen.keys() == shown.keys():
                tried = [place for place, why_not in shown.items() if not why_not]
                raise NotObservable(trial.unseen[next(iter(tried or shown))])

        functools.update_wrapper(play, function, updated=())
        del play.__wrapped__  # type: ignore[attr-defined]  # whoever collects it gives it a trial
        found = {
            side: Check(requirement, places, may_crash, profile, side, play)
            for side, places in sides.items()
        }
        play.checks = found  # type: ignore[attr-defined]
        return play

    return declare


def _through(
    function: Callable[..., bool | None],
    trial: Any,
    end: End,
    given: Callable[..., Any] | None,
    cases: Choice | Mapping[End, Choice] | None,
) -> None:
    arguments = [trial] if end.place is None else [trial, end.place]
    with ExitStack() as held:
        if given:
            setting = given(*arguments)
            context = isinstance(setting, AbstractContextManager)
            arguments.append(held.enter_context(setting) if context else setting)
        if cases is None:
            _count(trial, function, *arguments)
            return
        chosen = cases[end] if isinstance(cases, Mapping) else cases
        if not isinstance(chosen, Cases):
            chosen = chosen(*arguments)
        for case in trial.each(**chosen._asdict()):
            _count(trial, function, *arguments, case)


def _count(trial: Any, function: Callable[..., bool | None], *arguments: Any) -> None:
    """Sessions count themselves; else a case is delivered once."""
    before = trial.delivered
    if function(*arguments) is not False and trial.delivered == before:
        trial.delivered += 1


def paragraph(docstring: str | None) -> str:
    """A docstring on one line."""
    return " ".join((docstring or "").split())
