"""Telemetry: when it comes, to whom, and what a client makes of it (spec 1.1 annex A)."""

import functools
import time
from itertools import pairwise
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import CLIENT, SERVER, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.clocks import ClockReading, expect_one_offset, read_clock
from splatbus_conformance.trials.moves.image_session import answers
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import is_number, show, texts, whole, within
from splatbus_conformance.wire.messages import SERIES, Json
from splatbus_conformance.wire.sockets import Connection

TELLS = ("1.1", "capability:telemetry")
MOVE_SECONDS = 0.05
"""Between moves of the camera, so that there is something to tell."""
TELEMETRY_SECONDS: float = LIMITS["telemetry_seconds"]
UNKNOWN = "splatbus-conformance: no such series"
WORDS = st.text("abcdefghijklmnopqrstuvwxyz_", min_size=1, max_size=20)
VALUES = st.none() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | WORDS
MEMBERS = st.dictionaries(st.sampled_from(("value", "unit", "edges", "counts")) | WORDS, VALUES)
KNOWN_KINDS = {series["kind"] for series in SERIES}
OF_UNKNOWN_KINDS = st.builds(
    lambda kind, members: {**members, "name": "later", "kind": kind},
    *(WORDS.filter(lambda word: word not in KNOWN_KINDS), MEMBERS),
)


class TelemetryReader:
    """A client that subscribes, beside a reader of images that follow the camera."""

    def __init__(self, trial: ServerTrial, connection: Connection | None = None) -> None:
        self.trial = trial
        if connection is None and trial.facts.renders and trial.facts.opens:
            trial.reading()  # so that images are rendered, of which there is something to tell
        self.connection = connection or trial.commanding()

    def told(self) -> list[Json]:
        """Every `telemetry` that came."""
        heard = self.trial.with_(self.connection).heard
        return [message for message in heard if message.get("type") == "telemetry"]

    def expect_nothing(self, code: str, to: str) -> None:
        """None came."""
        self.trial.expect(not self.told(), code, f"a telemetry came {to}")

    def is_told(self, name: str, since: int) -> bool:
        """Whether a series came, past so many messages."""
        return any(name in names_in(message) for message in self.told()[since:])

    def subscribe(self, names: list[str] | None) -> int:
        """Subscribe, and wait until that is understood; how many messages had come by then."""
        self.trial.viewer.say(self.connection, {"type": "subscribe_telemetry", "names": names})
        answered = answers(self.trial, self.connection)
        self.trial.expect(answered, "no-reply", f"after a subscription to {show(names)}: no reply")
        return len(self.told())

    def listen(self, known: int, more: int) -> None:
        """Move the camera until so many more messages than are known have come, or for a while."""
        clock = self.trial.peer.clock
        until = clock() + EFFECT_SECONDS
        while clock() < until and len(self.told()) < known + more:
            self.trial.move()
            self.trial.wait(lambda: len(self.told()) >= known + more, MOVE_SECONDS)

    def hear(self) -> None:
        """Until two more messages have come, as they do to whoever has subscribed to them."""
        known = len(self.told())
        self.listen(known, 2)
        self.trial.expect(
            len(self.told()) > known,
            "told-nothing",
            "a client that has subscribed to everything is sent no telemetry any more",
        )

    def names(self) -> list[str]:
        """Which series there are; skips the check if none are told."""
        before = self.subscribe(None)
        self.listen(before, 2)
        found = [name for message in self.told()[before:] for name in names_in(message)]
        if not found:
            self.trial.not_observable("a client that subscribes to everything is sent no telemetry")
        return list(dict.fromkeys(found))


def names_in(message: Json) -> list[str]:
    """The names of the series in a message."""
    held: Any = message.get("series")
    return texts([within(it, "name") for it in held]) if isinstance(held, list) else []


@check("TEL-2", on={SERVER: TELLS})
def check_numbers_what_it_tells(trial: ServerTrial) -> None:
    """Everything is subscribed to while the camera moves; the numbers of what is told ascend, and
    its times are those of the server's clock.
    """
    listener = TelemetryReader(trial)
    before = listener.subscribe(None)
    clocks: list[ClockReading] = []
    if trial.facts.grants("ping"):
        clocks = [read_clock(trial, trial.greeted("msg"), 0.0, 1)]
    sent = time.monotonic()
    for _ in trial.each(range(100 if trial.thorough else 5)):
        known = len(listener.told())
        listener.listen(known, 1)
        for message in listener.told()[known:]:
            now = message.get("time")
            trial.expect(is_number(now), "not-a-number", f"the time of a telemetry is {show(now)}")
            last = ClockReading(
                sent, float(message["time"]), time.monotonic(), "time of a telemetry"
            )
            expect_one_offset(trial, [*clocks, last])
    told = [whole(message.get("seq")) or 0 for message in listener.told()[before:]]
    if not told:
        trial.not_observable("a client that subscribes to everything is sent no telemetry")
    ascends = all(a < b for a, b in pairwise(told))
    trial.expect(ascends, "not-ascending", f"the numbers of telemetry are {show(told[:20])}")


@check("TEL-3", on={SERVER: TELLS})
def check_tells_what_was_asked_for_alone(trial: ServerTrial) -> None:
    """Nothing is subscribed to, then everything, then some series, of which one is not there, and
    nothing again; beside it is a client that did not agree on telemetry, and one that is told
    everything, so that it is seen when something is. Who comes later has subscribed to nothing.
    """
    listener = TelemetryReader(trial)
    stranger = TelemetryReader(trial, trial.greeted("msg", capabilities=[]))
    trial.viewer.say(stranger.connection, {"type": "subscribe_telemetry", "names": None})
    answers(trial, stranger.connection)
    witness = TelemetryReader(trial, trial.greeted("msg"))
    trial.require_all(listener.connection, stranger.connection, witness.connection)
    known = witness.names()
    witness.hear()
    listener.expect_nothing("before-subscription", "before anything was subscribed to")
    listener.subscribe(None)  # what is not obeyed then is seen by what goes on to come
    wanted = st.lists(st.sampled_from([*known, UNKNOWN]), max_size=3, unique=True)
    for names in trial.each([[known[0], UNKNOWN], []], wanted, quick=1, full=100):
        before = listener.subscribe(names)
        witness.hear()
        for message in listener.told()[before:]:
            told = names_in(message)
            trial.expect(
                told and set(told) <= set(names),
                "other-series",
                f"{show(names)} was subscribed to, of {show(known)}, and told is {show(told)}",
            )
    left = TelemetryReader(trial, trial.greeted("msg"))
    left.subscribe(None)
    left.connection.close()
    heir = TelemetryReader(trial, trial.greeted("msg"))
    answered = answers(trial, heir.connection)
    trial.expect(answered, "no-reply", "no reply on the message channel")
    witness.hear()
    heir.expect_nothing("inherited-subscription", "to who has come after a subscriber")
    stranger.expect_nothing("not-granted", "to who had not agreed on telemetry")


@check("TEL-7", on={SERVER: TELLS})
def check_tells_everyone_who_subscribed(trial: ServerTrial) -> bool:
    """One client wants everything, another only the series that the first is told, each in turn:
    whenever the first is told it, so is the second, within 5 seconds.
    """
    witness, listener = TelemetryReader(trial), TelemetryReader(trial, trial.greeted("msg"))
    trial.require_all(witness.connection, listener.connection)
    compared = False
    for name in trial.each(witness.names()):
        before, known = listener.subscribe([name]), len(witness.told())
        witness.hear()
        if witness.is_told(name, known):
            is_told = functools.partial(listener.is_told, name, before)
            trial.expect(
                trial.peer.until(is_told, TELEMETRY_SECONDS + EFFECT_SECONDS),
                "not-told",
                f"{name!r} was told to who wants everything, and not to who wants that alone,"
                f" within {TELEMETRY_SECONDS:g} s",
            )
            compared = True
    return compared


@check(
    "TEL-6",
    on={CLIENT: ("hello:msg", "says:subscribe_telemetry", "returns:msg")},
    may_crash=True,
)
def check_ignores_series_of_unknown_kinds(trial: ClientTrial) -> None:
    """Telemetry in which series of kinds that nobody knows stand behind those of each kind. That
    the testee goes on is seen, not whether it kept the others.
    """
    listed = [{"name": "later", "kind": "vector"}]
    connection = subscribed(trial)
    for series in trial.each(listed, OF_UNKNOWN_KINDS, quick=5, full=50):
        connection = subscribed(trial) if connection.ended else connection
        trial.role.tell(connection, series)
        outcome = trial.outcome_on_msg(connection)
        trial.judge(outcome, f"a series of the kind {series['kind']!r}")


def subscribed(trial: ClientTrial) -> Connection:
    """A new connection on which the testee has subscribed to telemetry."""
    connection = trial.greeted("msg")
    dealings = trial.with_(connection)
    if not trial.wait(lambda: dealings.count("subscribe_telemetry") or connection.ended):
        trial.not_observable("the testee did not subscribe again")
    return connection
