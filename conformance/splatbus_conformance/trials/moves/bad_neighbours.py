"""What one client does that must not trouble the others (CHN-14)."""

from collections.abc import Callable
from typing import NamedTuple

from splatbus_schemas import LIMITS

from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

CROWD = 8
PASSERS_BY = 40
PACE_SECONDS = 0.001
"""Between connections, so that a server comes to accept them: a backlog that overflows costs its
client a second."""
UNREAD = 60_000
"""Requests, of which a quarter have more replies than the buffers of the systems hold, where these
are narrow."""
STUCK_SECONDS, TRY_SECONDS = 1.0, 0.02
"""A server that takes nothing for so long, though it could run, waits for its client to read."""
REQUEST = packet(encode(VIEWPORT_REQUEST))
LONGEST = LIMITS["max_payload_bytes"]
MANY_POSES = 20_000 * packet(encode(camera_pose()))
WORK_SECONDS = 60.0
"""For poses by the thousand, of a server that takes as long as it may for each."""


class BadNeighbour(NamedTuple):
    """Something that a client does on its connection."""

    what: str
    commit: Callable[[ServerTrial, Connection], object]
    begins: Callable[[ServerTrial, Channel], Connection] = ServerTrial.dial


def sends(what: str, data: bytes, ends: Callable[[Connection], None] | None = None) -> BadNeighbour:
    """One whose misdeed is what it sends, or how its connection ends then."""

    def commit(trial: ServerTrial, connection: Connection) -> None:
        connection.send(data)
        if ends:
            ends(connection)

    return BadNeighbour(what, commit)


def _never_reads(trial: ServerTrial, connection: Connection) -> None:
    """Ask until the server takes no more requests, or has far more than most can answer."""
    connection.stop_reading()
    sent, took = 0, trial.peer.clock()
    while sent < UNREAD * len(REQUEST) and trial.peer.clock() < took + STUCK_SECONDS:
        taken = connection.push((REQUEST * 100)[sent % len(REQUEST) :])
        if taken is None:
            break
        if taken:
            sent, took = sent + taken, trial.peer.clock()
        trial.rest(0.0 if taken else TRY_SECONDS)


def _sends_many_poses(trial: ServerTrial, connection: Connection) -> None:
    """Pose, and wait until all of it is worked off: how long that takes is not judged."""
    sent = connection.sent
    connection.send(MANY_POSES)
    if connection.channel == "msg" and connection.sent > sent:
        work_off(trial, connection)


def work_off(trial: ServerTrial, connection: Connection) -> None:
    """Wait until the server has come to the end of what was sent here; until then this client has
    control (POS-11), and whatever is asked next may wait, although the connection is closed.
    """
    before = len(trial.replies(connection))
    connection.send(REQUEST)
    trial.wait(lambda: len(trial.replies(connection)) > before or connection.ended, WORK_SECONDS)


def _reads(trial: ServerTrial, connection: Connection) -> None:
    """Be a good reader, if the server has any."""
    if trial.facts.welcome["ipc"] is not None:
        dealings = trial.with_(connection)
        trial.viewer.greet(connection)
        trial.wait(lambda: dealings.heard or connection.ended)


def _holds_a_lease(trial: ServerTrial, connection: Connection) -> None:
    """Take a frame and give nothing back."""
    dealings = trial.with_(connection)
    dealings.holds = True
    trial.viewer.greet(connection)
    trial.wait(lambda: dealings.frames or connection.ended)


def _resets_with_a_lease(trial: ServerTrial, connection: Connection) -> None:
    _holds_a_lease(trial, connection)
    connection.reset()


HARMLESS: dict[Channel, BadNeighbour] = {
    "msg": sends("asks", REQUEST),
    "ipc": BadNeighbour("reads", _reads, ServerTrial.before_hello),
}
BAD_NEIGHBOURS = (
    sends("says nothing", b""),
    sends("sends one byte", b"\x1c"),
    sends("sends a header and no more", REQUEST[:4]),
    sends("sends half a packet", REQUEST[:16]),
    sends("sends half of the longest packet", packet(b" " * LONGEST)[: LONGEST // 2]),
    sends("announces four gigabytes", b"\xff\xff\xff\xff"),
    sends("announces nothing", b"\x00\x00\x00\x00"),
    sends("speaks HTTP", b"GET / HTTP/1.1\r\nHost: localhost:6000\r\n\r\n"),
    sends("sends noise", bytes(range(1, 256)) * 257),
    sends("sends a thousand packets of noise", 1000 * packet(b"\xff{[")),
    sends("sends a thousand unknown messages", 1000 * packet(b'{"type":"weather_report"}')),
    sends("sends deep text", packet(b"[" * 100_000)),
    sends("sends a bad length and much more", bytes(4) + b" " * (4 * LONGEST)),
    BadNeighbour("sends twenty thousand poses", _sends_many_poses),
    BadNeighbour("never reads its replies", _never_reads, ServerTrial.dial_narrowly),
    sends("ends its stream in the middle of a packet", REQUEST[:9], Connection.end_stream),
    sends("resets at once", b"", Connection.reset),
    sends("resets in the middle of a packet", REQUEST[:16], Connection.reset),
    sends("resets before its replies come", 100 * REQUEST, Connection.reset),
    sends("closes before its reply comes", REQUEST, Connection.close),
    sends("closes before its replies come", 100 * REQUEST, Connection.close),
    sends("sends a broken pose and resets", packet(encode(camera_pose())[:-1]), Connection.reset),
    sends("closes at once", b"", Connection.close),
)
BAD_READERS = (
    BadNeighbour("never gives a frame back", _holds_a_lease, ServerTrial.before_hello),
    BadNeighbour("resets while it holds a frame", _resets_with_a_lease, ServerTrial.before_hello),
)


def crowd(trial: ServerTrial, channel: Channel) -> None:
    """Passers-by who come and go at once, then clients that stay and say nothing."""
    for _ in range(PASSERS_BY):
        trial.before_hello(channel).close()
        trial.rest(PACE_SECONDS)
    for _ in range(CROWD):
        trial.before_hello(channel)
        trial.rest(PACE_SECONDS)
