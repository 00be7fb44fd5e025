"""What one client does that must not trouble the others, at the pace of a server that is kept from
running for a while."""

from types import SimpleNamespace

from splatbus_conformance.trials.moves import bad_neighbours


class Pipe:
    """A connection to a server that takes nothing at some times."""

    def __init__(self, takes: list[bool]) -> None:
        self.takes, self.taken = takes, 0
        self.channel, self.ended, self.sent = "msg", None, 0

    def stop_reading(self) -> None:
        pass

    def push(self, data: bytes) -> int:
        took = len(data) if not self.takes or self.takes.pop(0) else 0
        self.taken += took
        return took

    def send(self, data: bytes) -> None:
        self.sent += len(data)


def trial_with_a_clock() -> SimpleNamespace:
    """A trial whose testee could run for as long as was rested."""
    rested: list[float] = []
    return SimpleNamespace(rest=rested.append, peer=SimpleNamespace(clock=lambda: sum(rested)))


def test_who_never_reads_asks_on_after_its_server_was_held_up() -> None:
    held_up = Pipe([*[True] * 10, *[False] * 20, *[True] * 10, *[False] * 20])
    bad_neighbours._never_reads(trial_with_a_clock(), held_up)  # type: ignore[arg-type]
    assert held_up.taken >= bad_neighbours.UNREAD * len(bad_neighbours.REQUEST)


def test_who_never_reads_stops_where_its_server_takes_nothing_more() -> None:
    stuck = Pipe([True, *[False] * 10_000])
    trial = trial_with_a_clock()
    bad_neighbours._never_reads(trial, stuck)  # type: ignore[arg-type]
    assert stuck.taken < bad_neighbours.UNREAD * len(bad_neighbours.REQUEST)
    assert trial.peer.clock() >= bad_neighbours.STUCK_SECONDS


def test_many_poses_are_worked_off_before_others_are_looked_at() -> None:
    replies: list[object] = []
    waits: list[float] = []

    def wait(condition: object, seconds: float) -> None:
        assert not condition()  # type: ignore[operator]
        replies.append({"viewport_size": [1, 1]})
        assert condition()  # type: ignore[operator]
        waits.append(seconds)

    trial = SimpleNamespace(replies=lambda connection: replies, wait=wait)
    bad_neighbours._sends_many_poses(trial, Pipe([]))  # type: ignore[arg-type]
    assert waits == [bad_neighbours.WORK_SECONDS]
