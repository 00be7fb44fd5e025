"""Checks on telemetry (spec 1.1 annex A)."""

import time
from itertools import pairwise
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.trials.moves.clocks import ClockReading, expect_one_offset, read_clock
from splatbus_conformance.trials.moves.image_session import answers
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.json_values import is_number, show, texts, whole, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

TELLS = ("1.1", "capability:telemetry")
MOVE_SECONDS = 0.05
"""Between moves of the camera, so that there is something to tell."""
TELEMETRY_SECONDS: float = LIMITS["telemetry_seconds"]
UNKNOWN = "splatbus-conformance: no such series"


class TelemetryReader:
    """A client that subscribes, beside a reader of images that follow the camera."""

    def __init__(self, trial: ServerTrial, connection: Connection | None = None) -> None:
        self.trial = trial
        if connection is None and trial.facts.renders and trial.facts.opens:
            trial.reading()  # so that images are rendered, of which there is something to tell
        self.connection = connection or trial.commanding()

    def told(self) -> list[Json]:
        """Every `telemetry` that came."""
        return telemetry_on(self.trial, self.connection)

    def subscribe(self, names: list[str] | None) -> int:
        """Subscribe, and wait until that is understood; how many messages had come by then."""
        self.trial.viewer.say(self.connection, {"type": "subscribe_telemetry", "names": names})
        answered = answers(self.trial, self.connection)
        self.trial.expect(answered, "no-reply", f"after a subscription to {show(names)}: no reply")
        return len(self.told())

    def listen(self, seconds: float, enough: int = 10**6) -> None:
        """Move the camera for a while, or until so many messages have come."""
        clock = self.trial.peer.clock
        until = clock() + seconds
        while clock() < until and len(self.told()) < enough:
            self.trial.move()
            self.trial.wait(lambda: len(self.told()) >= enough, MOVE_SECONDS)

    def hear(self) -> None:
        """Until two more messages have come, as they do to whoever has subscribed to them."""
        known = len(self.told())
        self.listen(EFFECT_SECONDS, known + 2)
        heard = len(self.told()) > known
        self.trial.expect(
            heard, "told-nothing", "who has subscribed to everything is told nothing any more"
        )

    def names(self) -> list[str]:
        """Which series there are; skips the check if none are told."""
        before = self.subscribe(None)
        self.listen(EFFECT_SECONDS, before + 2)
        found = [name for message in self.told()[before:] for name in names_in(message)]
        if not found:
            self.trial.not_observable("who subscribes to everything is told nothing")
        return list(dict.fromkeys(found))


def telemetry_on(trial: ServerTrial, connection: Connection) -> list[Json]:
    """Every `telemetry` that came on a connection."""
    heard = trial.viewer.with_(connection).heard
    return [message for message in heard if message.get("type") == "telemetry"]


def names_in(message: Json) -> list[str]:
    """The names of the series in a message."""
    held: Any = message.get("series")
    return texts([within(it, "name") for it in held]) if isinstance(held, list) else []


@check("TEL-2", observable="the numbers and the times of telemetry", on={SERVER: TELLS})
def check_numbers_what_it_tells(trial: ServerTrial) -> None:
    """Everything is subscribed to while the camera moves."""
    listener = TelemetryReader(trial)
    before = listener.subscribe(None)
    clocks: list[ClockReading] = []
    if trial.facts.grants("ping"):
        clocks = [read_clock(trial, trial.greeted("msg"), 0.0, 1)]
    sent = time.monotonic()
    for _ in trial.each(range(100 if trial.thorough else 5)):
        known = len(listener.told())
        listener.listen(EFFECT_SECONDS, known + 1)
        for message in listener.told()[known:]:
            now = message.get("time")
            trial.expect(is_number(now), "not-a-number", f"the time of a telemetry is {show(now)}")
            last = ClockReading(
                sent, float(message["time"]), time.monotonic(), "time of a telemetry"
            )
            expect_one_offset(trial, [*clocks, last])
            trial.delivered += 1
    told = [whole(message.get("seq")) or 0 for message in listener.told()[before:]]
    if not told:
        trial.not_observable("who subscribes to everything is told nothing")
    ascends = all(a < b for a, b in pairwise(told))
    trial.expect(ascends, "not-ascending", f"the numbers of telemetry are {show(told[:20])}")


@check("TEL-3", observable="the names in telemetry, and when none comes", on={SERVER: TELLS})
def check_tells_what_was_asked_for_alone(trial: ServerTrial) -> None:
    """Nothing is subscribed to, then everything, then some series, of which one is not there, and
    nothing again; beside it is a client that did not agree on telemetry, and one that is told
    everything, so that it is seen when something is. Who comes later has subscribed to nothing.
    """
    listener = TelemetryReader(trial)
    stranger = trial.greeted("msg", capabilities=[])
    trial.viewer.say(stranger, {"type": "subscribe_telemetry", "names": None})
    answers(trial, stranger)
    witness = TelemetryReader(trial, trial.greeted("msg"))
    trial.require_all(listener.connection, stranger, witness.connection)
    known = witness.names()
    witness.hear()
    trial.expect(
        not listener.told(),
        "before-subscription",
        "a telemetry came before anything was subscribed to",
    )
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
        trial.delivered += 1
    left = TelemetryReader(trial, trial.greeted("msg"))
    left.subscribe(None)
    left.connection.close()
    heir = trial.greeted("msg")
    trial.expect(answers(trial, heir), "no-reply", "no reply on the message channel")
    witness.hear()
    trial.expect(
        not telemetry_on(trial, heir),
        "inherited-subscription",
        "a telemetry came to who has come after a subscriber",
    )
    trial.expect(
        not telemetry_on(trial, stranger),
        "not-granted",
        "a telemetry came to who had not agreed on telemetry",
    )


@check("TEL-7", observable="when a series is told to each who wants it", on={SERVER: TELLS})
def check_tells_everyone_who_subscribed(trial: ServerTrial) -> None:
    """One client wants everything, another only the series that the first is told, each in turn:
    whenever the first is told it, so is the second, within 5 seconds.
    """
    witness, listener = TelemetryReader(trial), TelemetryReader(trial, trial.greeted("msg"))
    trial.require_all(witness.connection, listener.connection)
    for name in trial.each(witness.names()):
        before, known = listener.subscribe([name]), len(witness.told())
        witness.hear()
        if not any(name in names_in(it) for it in witness.told()[known:]):
            continue

        def is_told(name: str = name, before: int = before) -> bool:
            return any(name in names_in(it) for it in listener.told()[before:])

        told = trial.peer.until(is_told, TELEMETRY_SECONDS + EFFECT_SECONDS)
        what = f"{name!r} was told to who wants everything, and not to who wants that alone"
        trial.expect(told, "not-told", f"{what}, within {TELEMETRY_SECONDS:g} s")
        trial.delivered += 1
