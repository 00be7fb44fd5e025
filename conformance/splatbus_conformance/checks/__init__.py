"""Checks: each plays one scenario with the testee and judges one requirement by it.

A check is a function `check_*` that takes a `Trial`. Its docstring is what `explain` shows. The
set of outcomes that it accepts is the one that the specification lists for its requirement.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

DECLARES_HOST_MEMORY = ("hello:ipc", "capability:host_shm")
OPENS_HOST_MEMORY = (*DECLARES_HOST_MEMORY, "opens")
"""What a check needs that shows by opened memory that the testee goes on."""

F = TypeVar("F", bound=Callable[..., None])


@dataclass(frozen=True)
class Check:
    """What is known of a check before it runs."""

    requirement: str
    observable: str
    """What of the requirement can be seen from outside."""
    needs: tuple[str, ...]
    """What the testee must have shown of itself: `hello:ipc`, `hello:msg`, `msg`, `ipc`, `asks`,
    `poses`, `says:TYPE` of a message, `opens`, `returns:ipc`, `returns:msg`, or a capability; or a
    command of the adapter beside it, `adapter:pixels`, and its engine, `axes:unity`; or `device`,
    that there is a GPU or the stand-in CUDA runtime to show it memory of; or `stand-in`, that its
    calls are seen there. Of a server: `opens`, `frames`, `cuda`, `pixels`, that its images can be
    read here, and `scene`, that they are of the scene of `conformance/SCENE.md`."""
    may_crash: bool
    """It can end a testee that breaks the requirement: only with --launch or --allow-crash."""
    profile: str
    """The shortest that runs it: `brief`, or `quick` or `full` for what takes long."""

    @property
    def level(self) -> str:
        """The assurance of its verdict."""
        if {"device", "stand-in", "pixels"} & set(self.needs):
            return "L3"
        return "L2" if any(need.startswith("adapter:") for need in self.needs) else "L1"


def check(
    requirement: str,
    *,
    observable: str,
    needs: tuple[str, ...] = (),
    may_crash: bool = False,
    profile: str = "brief",
) -> Callable[[F], F]:
    """Declare a function to be the check of a requirement."""

    def declare(function: F) -> F:
        function.check = Check(requirement, observable, needs, may_crash, profile)  # type: ignore[attr-defined]
        return function

    return declare
