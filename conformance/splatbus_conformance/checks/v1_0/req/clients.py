"""Checks on what a client does with replies (spec 1.0 section 6.2)."""

import json
from collections import Counter
from collections.abc import Callable

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.replies import BAD_REPLIES as BAD_REPLIES_OF_1_1
from splatbus_conformance.checks import CLIENT, Cases, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.exchanges.asking import asking, requests
from splatbus_conformance.trials.trial import (
    EFFECT_SECONDS,
    ENDING_SECONDS,
    JITTER_SECONDS,
    REACTION_SECONDS,
)
from splatbus_conformance.wire.json_reading import shorten
from splatbus_conformance.wire.message_kinds import REPLY_TO, REQUESTS_1_0
from splatbus_conformance.wire.messages import Json, encode
from splatbus_conformance.wire.sockets import Connection

MOST_WAITS = 3
"""How often whoever asks on is given the time of an effect for the rest."""
TIMES_AGAIN = 4
"""Whoever asks for the size so often has read what it asked for in between."""
BAD_CAMERAS: tuple[Json, ...] = (
    {"position": [0, 0, 0]},
    {"rotation": [0, 0, 0, 1]},
    {"position": [0, 0], "rotation": [0, 0, 0, 1]},
    {"position": {"x": 0, "y": 0, "z": 0}, "rotation": {"x": 0, "y": 0, "z": 0, "w": 1}},
    {"position": [0, 0, None], "rotation": [0, 0, 0, 1]},
    {"position": ["0", "0", "0"], "rotation": ["0", "0", "0", "1"]},
    {"position": [0, 0, 1e39], "rotation": [0, 0, 0, 1]},
    {"position": [0, 0, 0], "rotation": [0, 0, 0, 0]},
    {"position": [0, 0, 0], "rotation": [0.5, 0.5, 0, 0]},
    {"position": [0, 0, 0], "rotation": [0, 0, 0, 1, 0]},
    {"position": [0, 0, 0], "rotation": [0, 0, 1]},
    {"position": [0, 0, 0], "rotation": []},
    {"position": None, "rotation": None},
)


def bad_replies(width: int, height: int) -> list[Json]:
    """Replies that break REQ-3 or REQ-5. Some clients stop when a size is not their own: what can
    be read of a broken one is.
    """
    sizes: list[object] = [
        *(None, [width], [width, height, 1], [-width, height], [width + 0.5, height]),
        *([float(width), float(height)], [1e300, 1e300], [str(width), str(height)]),
        *([None, None], [[width, height]], [True, True]),
        *(f"{width}x{height}", {"w": width, "h": height}, [2**63, 2**64]),
    ]
    return [{}, *({"viewport_size": size} for size in sizes), *BAD_CAMERAS]


def answer_all(trial: ClientTrial, connection: Connection) -> None:
    """Reply to what the testee has asked on this connection, as a good server does."""
    for request in requests(trial, connection):
        trial.role.reply(connection, request)


def asked_again(trial: ClientTrial, connection: Connection, times: int = TIMES_AGAIN) -> bool:
    """Whether all was asked for on this connection, and the size so many times: so often, that the
    replies to all were read.
    """
    made = Counter(message["type"] for message in requests(trial, connection))
    return made["get_viewport_size"] >= times and made.keys() >= trial.facts.asks


def wait_for_all(trial: ClientTrial, connection: Connection, times: int) -> bool:
    """Whether it asks again for all, as `asked_again`; it has time as long as it asks on at all."""
    for _ in range(MOST_WAITS):
        before = len(requests(trial, connection))
        if trial.wait(lambda: asked_again(trial, connection, times) or connection.ended):
            break
        if len(requests(trial, connection)) == before:
            break
    return asked_again(trial, connection, times)


def asks_again_and_again(trial: ClientTrial) -> bool:
    """Whether whole, plain replies, from now on with the size [0,0], make the testee ask on."""
    nothing = {"viewport_size": [0, 0]}  # the lens of cameras is that of images that there are
    trial.role.spoil = lambda reply: reply | nothing if "viewport_size" in reply else reply
    connection = asking(trial)
    answer_all(trial, connection)
    seconds = EFFECT_SECONDS if "get_viewport_size" in trial.facts.asks else REACTION_SECONDS
    trial.wait(lambda: asked_again(trial, connection) or connection.ended, seconds)
    return asked_again(trial, connection)


def outcome_of_reading(trial: ClientTrial, connection: Connection) -> str:
    """What the testee does after it was sent something on the message channel.

    As `outcome_on_msg`; one that is not known to come back shows by going on, or by noticing that
    the harness closes, that it has read it. One that never notices that shows nothing: it ignores,
    and nothing was delivered.
    """
    if "msg" in trial.facts.returns:
        return trial.outcome_on_msg(connection)
    if trial.fate() is None and not connection.ended:
        connection.end_stream()
        noticed = trial.ends(connection)
        trial.wait(trial.fate, REACTION_SECONDS)
        leaves = trial.facts.leaves and trial.fate() == "exits"
        if noticed and (leaves or trial.fate() is None):
            trial.delivered += 1
            return "ignores"
        if trial.fate() is None and not _notices_the_end_after_replies(trial):
            return "ignores"
    if connection.ended and not trial.wait(trial.fate, ENDING_SECONDS):
        trial.delivered += 1  # it has closed, and lives
    return trial.fate() or ("closes" if connection.ended else "hangs")


def _notices_the_end_after_replies(trial: ClientTrial) -> bool:
    """Whether it closes a connection whose stream ends after whole, plain replies (CHN-17)."""
    if trial.facts.notices_the_end is None:
        role = trial.role
        spoil, role.spoil = role.spoil, lambda reply: reply
        spelling, role.encode["msg"] = role.encode["msg"], encode
        connection = asking(trial)
        answer_all(trial, connection)
        trial.wait(lambda: all(map(role.with_(connection).count, trial.facts.asks)))
        trial.rest(REACTION_SECONDS)
        connection.end_stream()
        trial.facts.notices_the_end = trial.ends(connection)
        role.spoil, role.encode["msg"] = spoil, spelling
    return trial.facts.notices_the_end


@check(
    "REQ-12",
    observable="when the testee asks for the size again after it was told [0,0]",
    on={CLIENT: ("asks",)},
)
def check_asks_again_after_a_while(trial: ClientTrial) -> None:
    """The size is [0,0] at first; the request that follows is timed."""
    if "get_viewport_size" not in trial.facts.asks:
        trial.not_observable("the testee does not ask for the size when it connects")
    trial.role.has_image = False
    connection = trial.connection("msg")
    dealings = trial.role.with_(connection)
    asks = trial.wait(lambda: dealings.count("get_viewport_size") or connection.ended)
    trial.role.has_image = True
    if not (asks and connection.messages):
        trial.not_observable("the testee does not ask for the size when it connects again")
    told = connection.arrived(connection.messages[-1])
    if not trial.wait(lambda: dealings.count("get_viewport_size") > 1):
        trial.expect(not trial.fate(), "ended", "told [0,0], it did not go on")
        trial.not_observable("the testee does not ask again: it may not need the size")
    asked = next(
        connection.arrived(it)
        for it in reversed(connection.messages)
        if it.type == "get_viewport_size"
    )
    least = LIMITS["ask_again_min_seconds"]
    trial.expect(
        asked - told >= least - JITTER_SECONDS,
        "too-soon",
        f"it asked again {1000 * (asked - told):.0f} ms later; {1000 * least:.0f} are asked for",
    )
    trial.delivered += 1


@check(
    "REQ-13",
    observable="the process lives, and the testee goes on or connects again",
    on={CLIENT: ("asks",)},
    cases=lambda trial: Cases(bad_replies(trial.role.width, trial.role.height), kind=_broken_where),
    may_crash=True,
)
def check_survives_bad_replies(trial: ClientTrial, bad: Json) -> None:
    """A request is answered with a reply that breaks its form, one way after another; of the size
    or of the camera, where the testee asks for both.
    """
    about = "position" if {"position", "rotation"} & bad.keys() else "viewport_size"
    request = "get_camera_pose" if about == "position" else "get_viewport_size"
    connection = asking(trial)
    replied = spoil(trial, bad, lambda it: about in it or request not in trial.facts.asks)
    answer_all(trial, connection)
    if not trial.wait(lambda: replied or connection.ended):
        trial.not_observable(f"the testee did not make the request {request} again")
    trial.judge(outcome_of_reading(trial, connection), f"the reply {json.dumps(bad)}")


def spoil(trial: ClientTrial, bad: Json, spoils: Callable[[Json], bool]) -> list[Json]:
    """Have these members and no others in the next reply to which that applies, and in no later:
    who closes for it, and comes back, is told what is right.

    Returns that reply, when it is sent.
    """
    replied: list[Json] = []

    def spoilt(reply: Json) -> Json:
        if replied or not spoils(reply):
            return reply
        replied.append({n: reply[n] for n in ("type", "id") if n in reply} | bad)
        return replied[-1]

    trial.role.spoil = spoilt
    return replied


def _broken_where(bad: Json) -> tuple[object, ...]:
    """The member that is broken, and how: missing, null, a fraction, too large, or otherwise."""
    name = next(iter(bad), "")
    values = str(bad.get(name))
    huge = any(sign in values for sign in ("e+", str(2**64)))
    rotation = bad.get("rotation")
    numbers = len(rotation) if isinstance(rotation, list) else None
    none = "None" in values, bad.get(name, 0) is None
    return name, none, ".0" in values, ".5" in values, huge, len(bad), numbers


def _of_1_1(trial: ClientTrial) -> Cases:
    kinds = sorted(REPLY_TO[request] for request in trial.facts.asks - set(REQUESTS_1_0))
    if not kinds:
        trial.not_observable("the testee makes no request of 1.1 when it connects")
    return Cases([(kind, broken) for kind in kinds for broken in BAD_REPLIES_OF_1_1[kind]])


@check(
    "JSN-10",
    observable="the process lives, and the testee goes on or connects again",
    on={CLIENT: ("hello:msg", "asks", "returns:msg")},
    cases=_of_1_1,
    may_crash=True,
)
def check_survives_bad_replies_of_1_1(trial: ClientTrial, case: tuple[str, Json]) -> None:
    """Requests of 1.1 that the testee makes by itself are answered with members that are missing,
    of another type, or of values that cannot be.
    """
    kind, broken = case
    replied = spoil(trial, broken, lambda it: it["type"] == kind)
    connection = trial.greeted("msg")
    if not trial.wait(lambda: replied or connection.ended):
        trial.not_observable(f"the testee did not ask for the {kind} again")
    text = shorten(json.dumps(replied[-1]), 400) if replied else "none"
    trial.judge(trial.outcome_on_msg(connection), f"the reply {text}")
