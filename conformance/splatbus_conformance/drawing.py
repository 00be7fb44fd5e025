"""Let Hypothesis draw cases, before any of them is delivered.

A live testee remembers, so a case is not independent of the one before it: Hypothesis only draws,
and the check delivers the cases one after the other. The same seed draws the same cases.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar
from unittest import mock

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.internal.conjecture import providers
from hypothesis.strategies import SearchStrategy

T = TypeVar("T")


@contextmanager
def seeds_meaning_the_same() -> Iterator[None]:
    """While this lasts, what Hypothesis draws hangs on the seed alone.

    It would else mix in constants that it finds in modules of the project in which it runs, which
    are others from one installation to the next, and keep them in a folder where the user works.
    It has no setting for that.
    """
    nothing = type(providers.GLOBAL_CONSTANTS)()
    with (
        mock.patch.object(providers, "_get_local_constants", return_value=nothing),
        mock.patch.object(providers, "CONSTANTS_CACHE", type(providers.CONSTANTS_CACHE)(1024)),
    ):
        yield


def draw(strategy: SearchStrategy[T], count: int, seed_number: int) -> list[T]:
    """Draw at most `count` different cases."""
    cases: list[T] = []

    @seed(seed_number)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def collect(case: T) -> None:
        cases.append(case)

    with seeds_meaning_the_same():
        collect()
    return cases
