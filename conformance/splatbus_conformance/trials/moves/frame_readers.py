"""Readers of a server's images, as its checks use them."""

from typing import NoReturn

from splatbus_conformance.images.memory.reading import Opened
from splatbus_conformance.trials.controls import shows
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.messages import Json, says_of
from splatbus_conformance.wire.sockets import Connection

LENDS = ("1.1", "frames")
"""What a server must have shown that lends images."""
DONE_SECONDS = 0.05
"""For a server to make something of what a reader says, and of its end."""


def fell_silent(trial: ServerTrial, reader: Connection, what: str) -> NoReturn:
    """No frame came to a reader that waits for one, from a server that has sent frames before.

    That is a violation, unless the reader was closed in favour of a later one, or somebody else may
    have control of the scene.
    """
    if (reader.ended and gave_way(trial, reader)) or not trial.testee.expendable:
        trial.not_observable(what)
    trial.violated("no-frame", f"{what}, as it did when it was met")


def expect_shown(trial: ServerTrial, reader: Connection, pose: Json) -> None:
    """A reader that waits sees the camera where this pose puts it."""
    if trial.sees(reader, pose) is None:
        fell_silent(trial, reader, "the server sent no frame of the newest pose")


def gave_way(trial: ServerTrial, ended: Connection) -> bool:
    """Whether a connection may have been ended in favour of a later one on its channel (CHN-13)."""
    on_it = (it for it in trial.peer.connections if it.channel == ended.channel)
    return any(it.opened > ended.opened for it in on_it)


def pause_for_an_image(trial: ServerTrial, least: float) -> float:
    """How long to wait for a frame that must not come, at least so many seconds: as long as it
    takes this server to show a reader, who comes and goes, that the camera has moved; twice.
    """
    reader = trial.reading()
    trial.grows(reader, trial.with_(reader).frames)
    began = trial.peer.clock()
    expect_shown(trial, reader, trial.move())
    reader.close()
    return max(least, 2.0 * (trial.peer.clock() - began))


def memory_of(trial: ServerTrial, reader: Connection) -> Opened:
    """What a reader has open."""
    memory = trial.with_(reader).memory
    if memory is None:
        trial.not_observable("a reader has no memory open")
    return memory


def contents(memory: Opened, slot: int) -> tuple[bytes, bytes]:
    """The colour and the depth of the image in a slot."""
    return memory.color(slot).tobytes(), memory.depth(slot).tobytes()


def holding(trial: ServerTrial) -> tuple[Connection, Json]:
    """A new reader, and the frame that it holds."""
    with trial.viewer.holding():
        connection = trial.reading()
    frames = trial.with_(connection).frames
    if not trial.grows(connection, frames):
        fell_silent(trial, connection, "the server sent no frame")
    return connection, frames[0]


def beside(trial: ServerTrial, *others: Connection) -> Connection:
    """One more reader; skips the check where the server serves fewer at a time."""
    connection = trial.reading()
    if any(other.ended for other in others):
        trial.not_observable("the server ends a connection in favour of a later one")
    return connection


def joined(trial: ServerTrial) -> Connection | None:
    """One more reader, with memory open here; None if the server refuses or closes it."""
    connection, _ = trial.answered("ipc")
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.memory or dealings.refusal or dealings.errors() or connection.ended)
    return None if dealings.memory is None else connection


def lent(trial: ServerTrial, connection: Connection) -> bool:
    """Whether a new reader is sent a frame, in time and before an error or the end."""
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.frames or dealings.errors() or connection.ended)
    return bool(dealings.frames)


def answer_and_leave(trial: ServerTrial, reader: Connection, generation: object, kind: str) -> None:
    """A reader answers an init packet once more, and goes."""
    trial.viewer.say(reader, says_of(generation, kind))
    trial.rest(DONE_SECONDS)
    reader.close()
    trial.rest(DONE_SECONDS)


def pinning(trial: ServerTrial, connection: Connection) -> Json | None:
    """Have a reader hold an image that no other reader holds: the frame, or None if none comes."""
    dealings = trial.with_(connection)
    dealings.holds = False
    if trial.sees(connection, trial.move()) is None:
        return None
    dealings.holds = True
    return following(trial, connection, trial.move())


def following(trial: ServerTrial, connection: Connection, pose: Json) -> Json | None:
    """The frame of this pose that a reader holds once it has given back those before it, which a
    server sends all the time whose scene moves by itself; None if it does not come in time.
    """
    dealings = trial.with_(connection)
    clock = trial.peer.clock
    deadline = clock() + EFFECT_SECONDS
    while not connection.ended and clock() < deadline:
        held = dealings.held
        if held is not None and shows(held, pose):
            return held
        if held is not None:
            trial.viewer.release(connection, held)
        trial.wait(lambda: dealings.held or connection.ended, deadline - clock())
    return None
