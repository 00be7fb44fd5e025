"""Let Hypothesis draw cases, or climb towards the worst of them.

A live testee remembers, so a case is not independent of the one before it: Hypothesis only draws,
and the check delivers the cases one after the other. The same seed draws the same cases, and a
search meets the same ones if the testee makes the same errors; elsewhere it may draw others, for
Hypothesis tries constants, too, that it finds in the project in which it runs. What failed is
delivered again by its script, which does not draw.
"""

import math
import threading
from collections.abc import Callable, Iterator, Mapping
from queue import SimpleQueue
from typing import NamedTuple, TypeVar

from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings, target
from hypothesis.configuration import set_hypothesis_home_dir
from hypothesis.strategies import SearchStrategy, integers

from splatbus_conformance.data import cache_folder

T = TypeVar("T")
Scores = Mapping[str, float]
"""How bad a case was, by the name of what was measured."""


def leave_nothing_where_the_user_works() -> None:
    """Have Hypothesis keep its table of characters elsewhere, for the rest of this process."""
    set_hypothesis_home_dir(cache_folder() / "hypothesis")


def know_all_modules() -> None:
    """Have Hypothesis look through the modules of this process, as it does when it first draws: for
    those that are forked from it.
    """
    leave_nothing_where_the_user_works()
    draw(integers(), 100, 0)  # it looks for a constant in one draw of twenty


def draw(strategy: SearchStrategy[T], count: int, seed_number: int) -> list[T]:
    """Draw at most `count` different cases, at random."""
    cases: list[T] = []

    @seed(seed_number)
    @_settings(count, Phase.generate)
    @given(strategy)
    def collect(case: T) -> None:
        cases.append(case)

    collect()
    return cases


class _Drawn(NamedTuple):
    case: object


class _Enough(Exception):  # noqa: N818 - no error
    """Nobody wants more cases."""


def climb(
    strategy: SearchStrategy[T],
    count: int,
    seed_number: int | str,
    scores: Callable[[], Scores],
) -> Iterator[T]:
    """Draw at most `count` different cases, each once the one before it was dealt with.

    The first half is drawn at random; the rest climbs, from the worst case of each quantity, as
    `hypothesis.target` does: by integers that are changed a little, one at a time.

    Args:
        strategy: what to draw from.
        count: how many cases.
        seed_number: the same one draws the same cases, if they are scored the same.
        scores: called when a case has been dealt with: how bad it was, 0 if not at all.
    """
    drawn: SimpleQueue[_Drawn | Exception | None] = SimpleQueue()
    scored: SimpleQueue[Scores | None] = SimpleQueue()
    enough = False

    @seed(seed_number)
    @_settings(count, Phase.generate, Phase.target)
    @given(strategy)
    def deliver(case: T) -> None:
        nonlocal enough
        if not enough:
            drawn.put(_Drawn(case))
            found = scored.get()
            enough = found is None
        if enough:  # Hypothesis tries again what raised
            raise _Enough
        for quantity, error in (found or {}).items():
            if 0.0 < error < math.inf:  # from an error of 0 there is no way that leads upwards
                target(error, label=quantity)

    def run() -> None:
        try:
            deliver()
            drawn.put(None)
        except Exception as error:
            drawn.put(error)

    # Hypothesis calls what it tests, and a check goes through its cases: one of them has to be in
    # a thread of its own. They take turns.
    thread = threading.Thread(target=run, daemon=True)
    try:
        thread.start()
        it = drawn.get()
        while isinstance(it, _Drawn):
            yield it.case  # type: ignore[misc]
            found = dict(scores())
            scored.put(found)
            it = drawn.get()
        if it is not None:
            raise it
    finally:
        scored.put(None)
        thread.join()


def _settings(count: int, *phases: Phase) -> settings:
    return settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=phases,
        suppress_health_check=list(HealthCheck),
        verbosity=Verbosity.quiet,
        report_multiple_bugs=False,
    )
