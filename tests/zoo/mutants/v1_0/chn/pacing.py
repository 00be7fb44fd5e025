"""Mutants that break CHN-21, CHN-22 and NEG-24: when a channel connects again."""

import itertools

from tests.zoo.faults.seams import client
from tests.zoo.mutant import mutant

PACES = "check_paces_its_attempts"


@mutant("CHN-21", check=PACES, code="too-soon")
def connects_again_at_once(patch):
    """Connects again without a pause."""
    client.DELAYS_OF_ATTEMPTS.replace(patch, lambda: itertools.repeat(0.0))


@mutant("CHN-21", check=PACES, code="too-soon")
def connects_again_at_once_to_its_one_channel(patch):
    """Has the IPC channel alone, and connects to it again after 3 milliseconds."""
    client.DELAYS_OF_ATTEMPTS.replace(patch, lambda: itertools.repeat(0.003))

    def connect(original, self, now):
        if self.name == "IPC":
            original(self, now)
        else:
            self.due = now + 600

    client.CONNECTS.wrap(patch, connect)


def _waits(patch, seconds, applies):
    """Wait so long, where it applies to what was lost and why."""

    def lose(original, self, reason, now):
        ends = applies(self, reason)
        original(self, reason, now)
        if ends:
            self.due = now + seconds

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-21", check=PACES, code="too-soon")
def connects_again_at_once_when_reset(patch):
    """Connects again without a pause when its connection was reset."""
    _waits(patch, 0.0, lambda self, reason: "reset" in reason)


@mutant(
    "CHN-21",
    check="check_paces_attempts_that_are_refused",
    code="too-soon",
)
def connects_again_at_once_when_refused(patch):
    """Tries again without a pause, but for a millisecond, when it was refused."""
    client.DELAYS_OF_ATTEMPTS.replace(patch, lambda: itertools.repeat(0.25))
    _waits(patch, 0.001, lambda self, reason: self.machine is None)


@mutant("CHN-21", check=PACES, code="too-soon")
def connects_again_at_once_when_complained_to_twice(patch):
    """Connects again without a pause when the server has complained before it said welcome."""
    _waits(patch, 0.0, lambda self, reason: _complained(self))


@mutant("CHN-21", check="check_paces_attempts_without_images", code="too-soon")
def connects_again_at_once_when_it_cannot_open(patch):
    """Drops a connection whose memory it cannot open, and connects again without a pause."""

    def open_failed(original, self, *arguments):
        original(self, *arguments)
        hopeless.add(self)

    def flush(original, self, now):
        original(self, now)
        if self.machine in hopeless:
            self.lose("it has nothing to show", now)
            self.due = now

    hopeless: set[object] = set()
    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)
    client.FLUSHES.wrap(patch, flush)


@mutant("NEG-24", check="check_pauses_after_errors", code="too-soon")
def connects_again_at_once_after_an_error(patch):
    """Connects again without a pause when the server has complained."""
    _waits(patch, 0.0, lambda self, reason: _complained(self))


@mutant("NEG-24", check="check_pauses_after_errors", code="too-soon")
def connects_again_at_once_after_every_other_error(patch):
    """Connects again without a pause at every other complaint of the server."""
    _waits(patch, 0.0, lambda self, _: _complained(self) and self.status.connections % 2 == 1)


@mutant("NEG-24", check="check_pauses_after_errors", code="too-soon")
def connects_again_at_once_after_an_error_about_messages(patch):
    """Connects its message channel again without a pause when the server has complained there."""
    _waits(patch, 0.0, lambda self, _: self.name == "message" and _complained(self))


@mutant("CHN-22", check="check_comes_back_soon", code="too-late")
def stays_away_after_an_error(patch):
    """Waits a minute when the server has complained."""
    _waits(patch, 60.0, lambda self, reason: _complained(self))


@mutant("CHN-22", check="check_comes_back_soon", code="too-late")
def backs_off_too_far(patch):
    """Waits 0.125 seconds after the first failure, and 8 after the second."""
    client.DELAYS_OF_ATTEMPTS.replace(
        patch, lambda: itertools.chain([0.125], itertools.repeat(8.0))
    )


def _complained(self):
    return "the server says" in (self.status.problem or "")
