"""Sessions: lists of steps in any order, each taken with the testee, and what must hold after each.

A part plays the other side, client or server: it knows from the steps so far which may come next,
takes them, and raises `Breach` where the testee does what a requirement does not accept. So a list
of steps is all that it takes to show a failure again.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol

Step = tuple[Any, ...]
"""What is done, and its arguments: strings and numbers."""


class SessionBreach(Exception):  # noqa: N818 - a finding, no error of ours
    """The testee broke a requirement."""

    def __init__(self, requirement: str, code: str, what: str) -> None:
        super().__init__(what)
        self.requirement, self.code = requirement, code


class SessionOver(Exception):  # noqa: N818 - a finding, no error of ours
    """The testee has ended as it may; the session ends too."""


class Counterpart(Protocol):
    """The other side of one session."""

    def begin(self) -> None:
        """Meet the testee on new connections."""

    def choices(self, kind: str) -> Sequence[Step]:
        """The steps of a kind that may come next; they depend on the steps before alone."""

    def take(self, step: Step) -> None:
        """Take a step, and look whether all is as it must be at any moment."""

    def settle(self) -> None:
        """Let the testee come to rest, look whether all is as it must be then, and end."""

    def leave(self) -> None:
        """End without a look, from wherever the session is."""


class BreachFound(Exception):  # noqa: N818 - a finding, no error of ours
    """A session broke the requirement that is judged."""

    def __init__(self, steps: Sequence[Step], code: str, what: str) -> None:
        super().__init__(what)
        self.steps, self.code = tuple(steps), code

    def __str__(self) -> str:
        return f"{self.args[0]}; the session: {in_words(self.steps)}"


class Session:
    """One session: the steps that were taken, as far as they went.

    Once a requirement was broken that is not judged, nothing more can be said: further steps are
    left out.
    """

    def __init__(self, part: Counterpart, judged: str, steps: list[Step] | None = None) -> None:
        self.steps: list[Step] = [] if steps is None else steps
        self.other: SessionBreach | None = None
        """What was broken that is not judged here."""
        self._part, self._judged = part, judged
        self._goes_on = True
        self._do(part.begin, "at the beginning")

    def choices(self, kind: str) -> Sequence[Step]:
        """The steps of a kind that may come next."""
        return self._part.choices(kind)

    def take(self, step: Step) -> None:
        """Take a step; one that may not come now is left out. Raises Found."""
        if self._goes_on and step in self._part.choices(step[0]):
            self.steps.append(step)
            at = f"at step {len(self.steps)} ({in_words([step])})"
            self._do(lambda: self._part.take(step), at)

    def end(self) -> None:
        """Let it come to its end. Raises Found."""
        if self._goes_on:
            self._do(self._part.settle, "at the end")
            self._goes_on = False

    def _do(self, action: Callable[[], None], when: str) -> None:
        try:
            action()
        except SessionOver:
            self._goes_on = False
            return
        except SessionBreach as breach:
            found = breach
        else:
            return
        self._goes_on = False
        self._part.leave()
        if found.requirement == self._judged:
            # Here alone, and outside of the handler: Hypothesis tells failures by where they are.
            raise BreachFound(self.steps, found.code, f"{when}, {found}")
        self.other = found


def in_words(steps: Iterable[Step]) -> str:
    """Steps as one line."""
    return "; ".join(" ".join(map(str, step)) for step in steps) or "no step"
