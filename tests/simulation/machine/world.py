"""Virtual time, and one source of chance for all that happens in it."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import count
from random import Random

Act = Callable[[], None]
TICK = 0.001
"""By how much a sleeper wakes late, seconds: the system rounds its waits up to milliseconds."""


class BrokenError(Exception):
    """An invariant does not hold.

    Attributes:
        invariant: its name.
    """

    def __init__(self, invariant: str, told: str) -> None:
        super().__init__(f"{invariant}: {told}")
        self.invariant = invariant


class World:
    """What is to happen, in the order of its time.

    Attributes:
        random: draws everything.
        now: seconds.
        is_calm: nothing goes wrong any more.
        steps: how many there were.
        looked: how often each invariant was looked at.
        broken: the first invariant that did not hold; kept, for what runs may catch exceptions.
        tell: takes the trace, if somebody reads it.
    """

    def __init__(self, seed: int, tell: Callable[[str], None] | None = None) -> None:
        self.random, self.thefts = Random(seed), Random(f"{seed}")
        self.now = 100.0
        self.is_calm = False
        self.steps = 0
        self.looked: Counter[str] = Counter()
        self.broken: BrokenError | None = None
        self.tell = tell
        self._order = count()
        self._due: list[tuple[float, int, Act]] = []

    def at(self, moment: float, act: Act) -> None:
        """Has it happen then."""
        heapq.heappush(self._due, (max(moment, self.now), next(self._order), act))

    def after(self, seconds: float, act: Act) -> None:
        """Has it happen so much later."""
        self.at(self.now + seconds, act)

    def run(self, until: float) -> None:
        """Lets happen what is due; may be called from within an act, which so takes time."""
        while self._due and self._due[0][0] <= until:
            moment, _, act = heapq.heappop(self._due)
            self.now = max(self.now, moment)
            self.steps += 1
            act()
            if self.broken is not None:
                raise self.broken
        self.now = max(self.now, until)

    def chance(self, probability: float) -> bool:
        """Whether something goes wrong that does so with this probability; never in the calm."""
        return not self.is_calm and self.random.random() < probability

    def is_stolen(self) -> bool:
        """Whether another program takes memory now; drawn apart, so that all else is as without."""
        return not self.is_calm and self.thefts.random() < 0.003

    def note(self, *told: object) -> None:
        """Adds a line to the trace, if there is one."""
        if self.tell is not None:
            self.tell(f"{self.now:11.6f}  " + " ".join(map(str, told)))

    def look(self, invariant: str, holds: bool, *told: object) -> None:
        """Looks at an invariant.

        Raises:
            BrokenError: it does not hold; `told` says how.
        """
        self.looked[invariant] += 1
        if not holds:
            error = BrokenError(invariant, " ".join(map(str, told)))
            self.broken = self.broken or error
            self.note("BROKEN", error)
            raise error


class Node:
    """A program on the machine: it sleeps, is woken, and has a clock of its own.

    Attributes:
        world: where it lives.
        is_alive: it has not ended.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self.is_alive = True
        self._ahead = world.random.random() * 1000.0
        self._wakes_at = math.inf
        self._paused_until = -math.inf

    def clock(self) -> float:
        """Seconds on a clock that never goes back."""
        return self.world.now + self._ahead

    def jump(self, seconds: float) -> None:
        """Sets the clock forward."""
        self._ahead += seconds
        self.wake()

    def work(self, seconds: float) -> None:
        """Takes some time, which nobody else notices."""
        self._ahead += seconds

    def pause(self, seconds: float) -> None:
        """Keeps it from running for a time; its clock goes on."""
        self._paused_until = self.world.now + seconds

    def go_on(self) -> None:
        """Ends a pause."""
        self._paused_until = self.world.now
        self.wake()

    def wake(self) -> None:
        """Has it take a turn, in a moment."""
        self.turn_at(self.world.now + self.world.random.random() * 0.001)

    def sleep(self, seconds: float) -> None:
        """Has it take a turn after so many seconds on its clock, if nothing wakes it before."""
        if seconds < math.inf:
            self.turn_at(self.world.now + max(seconds, 0.0) + TICK)

    def turn_at(self, moment: float) -> None:
        """Has it take a turn at a moment, unless one is to come before that."""
        if self.is_alive and moment < self._wakes_at:
            self._wakes_at = moment
            self.world.at(moment, partial(self._wake_up, moment))

    def _wake_up(self, moment: float) -> None:
        if moment != self._wakes_at or not self.is_alive:
            return  # an earlier one took its place
        self._wakes_at = math.inf
        if self.world.now < self._paused_until:
            self.turn_at(self._paused_until)
        else:
            self.turn()

    def turn(self) -> None:
        """What it does when it is awake."""
        raise NotImplementedError
