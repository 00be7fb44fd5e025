"""What is known of a server before sessions with it: whom it serves, and what cameras it has."""

import functools
from typing import NamedTuple

from splatbus_conformance.checks.stateful.scripted_clients import pose_of
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee.server_probe import reach
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import Connection

SEATS = 3
"""Most clients of a session on each channel."""
CAMERAS = 3
"""Cameras that are asked for."""
MOST_COUNTED = 12
SERVED_SECONDS = 1.0


class Knowledge(NamedTuple):
    """What a server serves."""

    seats: dict[Channel, int]
    """How many clients at a time, as far as sessions need them."""
    cameras: tuple[Json | None, ...]
    """The replies to requests for the first cameras."""
    greets: bool
    """It answers `hello`."""
    frames: bool
    """It lends frames, of memory that can be opened here."""
    subscribes: bool
    crowd: int
    """How many clients it lends frames at a time; 0 if that was not counted or is too many."""


def learn(trial: ServerTrial, *, counting: bool) -> Knowledge:
    """Try how many clients are served, and what the cameras are."""
    facts = trial.facts
    frames = facts.opens and facts.renders and "frames" in facts.capabilities()
    crowded = crowd(trial) if counting and frames else 0
    asking = [c for _ in range(SEATS) if (c := trial.served("msg"))]

    def answered(times: int) -> bool:
        return all(len(trial.replies(c)) >= times or c.ended for c in asking)

    for times in (1, 2):  # who was answered before the last had come may be ended for it
        for connection in asking:
            trial.viewer.say(connection, VIEWPORT_REQUEST)
        trial.wait(functools.partial(answered, times), SERVED_SECONDS)
    served = [c for c in asking if len(trial.replies(c)) > 1 and not c.ended]
    cameras = tuple(_camera(trial, served[0], n) if served else None for n in range(CAMERAS))
    greets = facts.version() == "1.1" and not facts.unauthorized
    for connection in asking:
        connection.close()
    return Knowledge(
        {"msg": len(served), "ipc": _seats_for_reading(trial, greets)},
        cameras,
        greets,
        frames,
        "subscribe" in facts.capabilities(),
        crowded if crowded < MOST_COUNTED else 0,
    )


def crowd(trial: ServerTrial) -> int:
    """How many clients, none of which releases what it holds, are lent a frame at a time."""
    former = trial.peer.on_message
    trial.viewer.releases, trial.peer.on_message = False, trial.viewer.on_message
    members: list[Connection] = []
    for _ in range(MOST_COUNTED):
        connection = _dialled(trial, "ipc")
        if connection is None or not _is_lent_a_frame(trial, connection):
            break
        members.append(connection)
    for connection in members:
        forget(trial, connection)
    trial.peer.on_message = former
    return len(members)


def forget(trial: ServerTrial, connection: Connection) -> None:
    """Close a connection, and the memory that came on it."""
    connection.close()
    dealings = trial.with_(connection)
    if dealings.memory is not None:
        dealings.memory.close()
        dealings.memory = None


def _is_lent_a_frame(trial: ServerTrial, connection: Connection) -> bool:
    trial.viewer.greet(connection)
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.frames or dealings.errors() or connection.ended, SERVED_SECONDS)
    if not dealings.frames:
        connection.close()
    return bool(dealings.frames)


def _seats_for_reading(trial: ServerTrial, greets: bool) -> int:
    """How many clients on the IPC channel are welcomed, or stay connected, at a time."""
    members = [c for _ in range(SEATS) if (c := _dialled(trial, "ipc"))]
    if greets:
        for connection in members:
            trial.viewer.greet(connection)
        dealings = {c: trial.with_(c) for c in members}
        trial.wait(
            lambda: all(d.init_packets or d.errors() or c.ended for c, d in dealings.items()),
            SERVED_SECONDS,
        )
        served = [d for c, d in dealings.items() if d.welcome and not d.errors() and not c.ended]
    else:
        trial.rest(SERVED_SECONDS / 4)
        served = [trial.with_(c) for c in members if not c.ended]
    for connection in members:
        forget(trial, connection)
    return len(served)


def _camera(trial: ServerTrial, connection: Connection, index: int) -> Json | None:
    before = len(trial.replies(connection))
    trial.viewer.say(connection, {"type": "get_camera_pose", "cam_idx": index})
    trial.wait(lambda: len(trial.replies(connection)) > before or connection.ended, SERVED_SECONDS)
    return next(map(pose_of, trial.replies(connection)[before:]), None)


def _dialled(trial: ServerTrial, channel: Channel) -> Connection | None:
    return reach(trial.peer, trial.testee, channel, trial.patience)
