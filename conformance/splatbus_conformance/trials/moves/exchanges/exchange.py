"""What a testee awaits on a connection, and whether it takes it: the control at either end."""

from collections.abc import Callable
from typing import NamedTuple

from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.device_listener import DeviceListener
from splatbus_conformance.trials.moves.exchanges.asking import asking, requests
from splatbus_conformance.trials.moves.exchanges.unheard import (
    outcome_at_the_end,
    silent_connection,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS, Place, Trial
from splatbus_conformance.wire.messages import Json, encode, hello, welcome
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

STRANGER: Json = {"type": "weather_report"}
"""A message that is ignored, for another to be joined to."""
ASKED: tuple[Json, ...] = (
    VIEWPORT_REQUEST,
    {"type": "get_camera_pose", "cam_idx": 0, "☃": ["\\", '"', "\u007f"]},
) * 3
"""More than one, for what is made of the next to be seen."""
MANY_REPLIES = 500


class Exchange(NamedTuple):
    """A connection, and what its testee awaits there."""

    connection: Connection
    awaited: list[Json]
    """Good messages for it; none where nobody knows what it awaits."""
    taken: Callable[[], bool | None]
    """Whether it is seen in time to take them, once; None where nothing shows it either way."""
    answers: Callable[[], int] = lambda: 0
    """How many replies have come on the connection by now, of a server."""

    @property
    def packets(self) -> list[bytes]:
        """What is awaited, as it is sent."""
        return [packet(encode(message)) for message in self.awaited]

    def leave(self, how: str) -> None:
        """End the connection: `close` it, or `reset` it."""
        getattr(self.connection, how)()


def exchange(
    trial: ClientTrial | ServerTrial,
    place: Place,
    later: bool = False,
    listener: DeviceListener | None = None,
) -> Exchange | None:
    """A connection on which the testee awaits something: the first that it does there, or what
    comes later, once it has taken that; None where nobody can see that it has.

    At `device` it is by this listener that it is seen.
    """
    if isinstance(trial, ServerTrial):
        return _with_a_server(trial, place, later)
    if listener:
        connection, image = listener.fresh(), listener.image()
        named = [image.init_packet()]
        return Exchange(connection, named, lambda: listener.comes_to_open(connection, image))
    return _replies(trial) if place == "msg" else _init_packet(trial, later)


def _init_packet(trial: ClientTrial, later: bool) -> Exchange | None:
    trial.role.offers_memory = trial.role.lends_frames = False
    if not trial.facts.speaks_1_1("ipc"):
        if later:
            return None
        silent = silent_connection(trial)
        legacy = [trial.role.legacy_init_packet()]
        return Exchange(silent, legacy, lambda: outcome_at_the_end(trial, silent) == "lives")
    connection = _with_open_memory(trial) if later else trial.for_init_packet()
    granted = trial.with_(connection).granted
    if later and "frames" in granted:
        frame = trial.next_frame(connection)
        return Exchange(connection, [frame], lambda: trial.releases(connection, frame["seq"]))
    if later and "reinit" not in granted:
        return Exchange(connection, [], lambda: None)
    init_packet = trial.role.init_packet(connection)
    return Exchange(connection, [init_packet], lambda: trial.opens(connection))


def _with_open_memory(trial: ClientTrial) -> Connection:
    newest = trial.peer.newest("ipc", lambda it: not it.gone and trial.with_(it).has_opened)
    if newest is not None:
        return newest
    connection = trial.for_init_packet()
    trial.role.offer(connection)
    trial.require_open(connection)
    return connection


def _replies(trial: ClientTrial) -> Exchange:
    """To all that is asked: whoever asks for more only after a reply, or again after the size
    [0,0], shows by that that it has read one, first where it is whole. Others must at least keep
    the connection.
    """
    trial.role.has_image = False
    if trial.facts.asks_on is None:
        whole = asked_on(trial, asking(trial))
        for reply in whole.awaited:
            trial.role.say(whole.connection, reply)
        trial.facts.asks_on = whole.taken() or False
    return asked_on(trial, asking(trial))


def asked_on(trial: ClientTrial, connection: Connection) -> Exchange:
    """What has been asked on a connection, and is answered by nobody else."""
    trial.role.replies = False
    trial.rest(REACTION_SECONDS)
    asked = requests(trial, connection)
    replies = [it for request in asked if (it := trial.role.answer(connection, request))]

    def more() -> bool:
        return len(requests(trial, connection)) > len(asked)

    def taken() -> bool | None:
        shows = trial.facts.asks_on is not False
        trial.wait(
            lambda: more() or connection.ended, EFFECT_SECONDS if shows else REACTION_SECONDS
        )
        return more() or (False if shows or connection.ended else None)

    return Exchange(connection, replies, taken)


def _with_a_server(trial: ServerTrial, place: Place, later: bool) -> Exchange:
    """As `exchange`; what came before is closed, unless it goes on there."""
    if not (later and place == "msg"):
        for former in trial.peer.connections:
            former.close()
    if place == "msg":
        return _requests(trial, later)
    if later or not trial.facts.welcome["ipc"]:
        return Exchange(trial.greeted("ipc") if later else trial.dial("ipc"), [], lambda: None)
    connection = trial.before_hello("ipc")
    said = hello(trial.viewer.capabilities["ipc"], trial.viewer.token)
    return Exchange(connection, [said], lambda: trial.is_welcomed(connection))


def judge_if_seen(trial: Trial, outcome: str, what: str) -> bool:
    """Judge an outcome, unless it is none; whether it is one."""
    if outcome:
        trial.judge(outcome, what)
    return bool(outcome)


def refusal(trial: ClientTrial) -> Exchange:
    """A connection on which hello was said; a testee closes it for a welcome with a version that
    it did not list (NEG-16).
    """
    trial.role.welcomes = False
    connection = trial.connection("msg")
    if not trial.says_hello(connection) or connection.ended:
        trial.not_observable("the testee said no hello on the msg channel, or closed by itself")

    def taken() -> bool:
        closes = trial.ends(connection)
        leaves = trial.facts.leaves and trial.fate() == "exits"
        if not closes or not (leaves or trial.fate() is None):
            return False
        trial.reassure("msg")
        return True

    return Exchange(connection, [welcome("msg", [], "9.9")], taken)


def require_refusal(trial: ClientTrial) -> None:
    """Skip the check of a testee that keeps the connection then."""
    it = refusal(trial)
    it.connection.send(it.packets[0])
    if not it.taken():
        trial.not_observable("the testee does not close on a version that it did not list")


def in_use(trial: ServerTrial) -> Connection:
    """The newest message connection, if it is there still; else another."""
    return trial.peer.newest("msg", lambda it: not it.gone) or trial.dial("msg")


def _requests(trial: ServerTrial, later: bool) -> Exchange:
    connection = _served(trial) if later else trial.dial("msg")
    before = len(trial.replies(connection))

    def count() -> int:
        return len(trial.replies(connection)) - before

    def taken() -> bool:
        in_time = trial.wait(lambda: count() >= len(ASKED) or connection.ended)
        return in_time and trial.answers(connection) and count() == len(ASKED) + 1

    return Exchange(connection, list(ASKED), taken, count)


def _served(trial: ServerTrial) -> Connection:
    """A connection on which requests were answered, of 1.1 where the server speaks that."""
    newest = trial.peer.newest(
        "msg", lambda it: not it.gone and 0 < len(trial.replies(it)) < MANY_REPLIES
    )
    if newest is not None:
        return newest
    connection = trial.greeted("msg") if trial.facts.welcome["msg"] else trial.dial("msg")
    trial.expect(trial.answers(connection), "no-reply", "no reply on the message channel")
    return connection
