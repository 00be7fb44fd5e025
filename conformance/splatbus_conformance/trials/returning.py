"""How a client comes back: after which time, and whether it means it.

Some look first, and close what they looked with; some pause longer each time.
"""

from typing import TYPE_CHECKING

from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection, Peer

if TYPE_CHECKING:
    from splatbus_conformance.trials.client import ClientTrial

PROBES = 2
"""Connections in a row that a testee may end for reasons of its own before one that it keeps."""
AGAIN = 2.0
"""How much longer than its longest pause so far its next may be."""
LATE_SECONDS = 1.0
MOST_RETURN_SECONDS = 40.0


def goes_on_with(trial: "ClientTrial", connection: Connection) -> bool:
    """Whether the testee says on this connection what it says on one that it keeps.

    A client that speaks 1.0 has nothing to say on the IPC channel.
    """
    if connection.channel == "msg":
        trial.wait(lambda: connection.packets or connection.ended)
        return bool(connection.packets)
    if not trial.facts.speaks_1_1("ipc"):
        return True
    role = trial.role
    role.welcome_whoever_waits(connection)
    dealings = role.with_(connection)

    def greeted() -> bool:
        return bool(dealings.welcome or (dealings.hello and not role.greets))

    trial.wait(lambda: greeted() or connection.ended)
    if not (greeted() and dealings.welcome and trial.facts.opens):
        return greeted()
    if not role.offers_memory:
        role.offer(connection, role.init_packet(connection))
    return trial.opens(connection)


def tries_to_go_on(trial: "ClientTrial", channel: Channel) -> tuple[int, bool]:
    """How many connections it makes until it goes on with one, and whether it comes to that."""
    for tries in range(1, 2 + PROBES):
        connection = trial.next_connection(channel)
        if connection is None:
            return tries, False
        if goes_on_with(trial, connection):
            trial.delivered += 1
            return tries, True
        if not connection.ended:
            return tries, False
    return tries, False


def past_probes(trial: "ClientTrial", channel: Channel, seconds: float) -> Connection | None:
    """A new connection; of a testee that has just been started, one that it means to keep."""
    found = trial.next_connection(channel, seconds)
    probes = trial.facts.probes.get(channel, 0)
    while found is not None and _since_start(trial, channel) <= probes:
        _answer_until_it_ends(trial, found)
        found = trial.next_connection(channel, seconds)
    return found


def _answer_until_it_ends(trial: "ClientTrial", probe: Connection) -> None:
    """Whatever the check withholds from the testee's other connections."""
    heard, answered = trial.role.with_(probe).heard, 0

    def ends() -> bool:
        nonlocal answered
        for request in heard[answered:] if not trial.role.replies else ():
            trial.role.reply(probe, request)
        answered = len(heard)
        return probe.ended is not None

    trial.wait(ends)


def _since_start(trial: "ClientTrial", channel: Channel) -> int:
    """How many connections the testee has made on a channel since it was started."""
    born = trial.testee.started
    on_it = [c for c in trial.peer.connections if c.channel == channel and c.opened >= born]
    return len(on_it) if born else 1 + trial.facts.probes.get(channel, 0)


def absence(peer: Peer, back: Connection, born: float) -> float:
    """How many seconds a testee stayed away that could have come back; 0 if it was started anew.

    Args:
        peer: that it came back to.
        back: its new connection.
        born: when its process was started, by the monotonic clock; 0 if that is not known.
    """
    former = [c.gone_since for c in peer.connections if c.channel == back.channel and c is not back]
    left = max((since for since in former if since is not None), default=None)
    if left is None or left < born:
        return 0.0
    return max(0.0, back.opened - max(left, peer.listens_since[back.channel]))


def return_seconds(trial: "ClientTrial") -> float:
    """How long a testee is waited for that may pause longer each time (CHN-22 is no MUST)."""
    next_pause = AGAIN * trial.facts.away_seconds + LATE_SECONDS
    return max(trial.patience, min(next_pause, MOST_RETURN_SECONDS))
