"""Checks on what a client asks for when it is told to wait (spec 1.1 chapter 8)."""

import time

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.checks.v1_1.neg.clients import listen
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.wire.conversation import Message
from splatbus_conformance.wire.messages import Json, error
from splatbus_conformance.wire.sockets import Connection

PAUSE: float = LIMITS["ask_again_min_seconds"]


@check(
    "VPT-9",
    observable="how soon after busy the testee asks for another size again",
    on={CLIENT: ("hello:msg", "says:set_viewport", "returns:msg")},
)
def check_asks_for_a_size_again_later(trial: ClientTrial) -> None:
    """Whoever asks for another size, is told `busy`, once all has come that it asks ahead."""
    waiting: list[Json] = []
    former = trial.peer.on_message

    def on_message(connection: Connection, message: Message) -> None:
        if message.value is None or message.type != "set_viewport":
            former(connection, message)
            return
        waiting.append(message.value)
        again.append(connection.arrived(message))

    again: list[float] = []
    trial.peer.on_message = on_message
    connection = trial.greeted("msg")
    if not trial.grows(connection, waiting):
        trial.not_observable("the testee did not ask for another size again")
    listen(trial, connection)
    again.clear()
    told = time.monotonic()
    for request in waiting:
        members = {"id": request["id"]} if "id" in request else {}
        trial.role.say(connection, error("busy", **members))
    trial.grows(connection, again, 0, 10 * PAUSE)
    pause = again[0] - told if again else PAUSE
    trial.expect(
        pause >= PAUSE, "too-soon", f"it asked again {1000 * pause:.0f} ms after it was told busy"
    )
    trial.delivered += 1
