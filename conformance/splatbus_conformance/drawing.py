"""Let Hypothesis draw cases, before any of them is delivered.

A live testee remembers, so a case is not independent of the one before it: Hypothesis only draws,
and the check delivers the cases one after the other. The same seed draws the same cases.
"""

from typing import TypeVar

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.strategies import SearchStrategy

T = TypeVar("T")


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

    collect()
    return cases
