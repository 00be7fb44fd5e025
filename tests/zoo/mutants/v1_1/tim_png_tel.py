"""Mutants that break TIM, PNG and TEL: time in the scene, the server's clock, telemetry."""

import time
from typing import Any

from splatbus_server import session
from splatbus_server.telemetry import Readings
from splatbus_wire.messages import SetTime

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant

SETS, PONG = "check_renders_at_the_time_that_was_set", "check_pong_tells_the_clock"
NUMBERS, ASKED = "check_numbers_what_it_tells", "check_tells_what_was_asked_for_alone"


def pongs(patch, change):
    """Change members of `pong`."""
    messages(patch, of_type("pong", lambda pong: pong | change(pong)))


@mutant("TIM-2", check=SETS, code="another-time")
def server_takes_any_time(patch):
    """Renders at times that the scene has not."""
    Seam(session, "within").replace(patch, lambda message, time_range: message)


@mutant("TIM-2", check=SETS, code="another-time", at=server.APPLIES_POSE)
def server_plays_on(original, self, message):
    """Takes no notice of the time that is set."""
    return self if isinstance(message, SetTime) else original(self, message)


@mutant("TIM-3", check="check_frames_tell_the_time_of_their_image", code="other-pixels")
def server_tells_the_time_before(patch):
    """Tells in each frame the time before the one that it shows."""
    former: list[Any] = []

    def before(frame):
        if frame["time"] not in former[-1:]:
            former.append(frame["time"])
        return frame | {"time": former[-2:][0]}

    messages(patch, of_type("frame", before))


@mutant("PNG-2", check=PONG, code="not-echoed")
def server_returns_its_own_time(patch):
    """Answers with its own time twice."""
    pongs(patch, lambda pong: {"t": pong["serverTime"]})


@mutant("PNG-2", code="another-time", through="PNG-2")
def server_rounds_what_it_returns(patch):
    """Returns `t` in whole milliseconds."""
    pongs(patch, lambda pong: {"t": round(pong["t"], 3)})


@mutant("PNG-2", check=PONG, code="not-in-between")
def server_tells_the_time_of_day(patch):
    """Tells another clock in `pong` than in frames."""
    pongs(patch, lambda pong: {"serverTime": time.time()})


@mutant("PNG-2", check=PONG, code="not-in-between")
def server_reads_its_clock_now_and_then(patch):
    """Reads its clock ten times a second, and tells what it read last."""
    last = [0.0]

    def read(pong):
        if pong["serverTime"] > last[0] + 0.1:
            last[0] = pong["serverTime"]
        return {"serverTime": last[0]}

    pongs(patch, read)


@mutant("PNG-3", check="check_the_clock_goes_on", code="server-time-goes-back")
def server_sets_its_clock(patch):
    """Sets its clock back by a second with every tenth ping."""
    count = [0]

    def late(pong):
        count[0] += 1
        return {"serverTime": pong["serverTime"] - (count[0] % 10 == 0)}

    pongs(patch, late)


@mutant("PNG-3", code="went-back", through="PNG-3")
def server_renders_in_the_past(patch):
    """Says of every second image that it was rendered ten seconds ago."""

    def past(frame):
        return frame | {"renderedAt": frame["renderedAt"] - 10.0 * (frame["seq"] % 2)}

    messages(patch, of_type("frame", past))


def telemetry(patch, change):
    """Change members of `telemetry`."""
    messages(patch, of_type("telemetry", lambda told: told | change(told)))


@mutant("TEL-2", check=NUMBERS, code="not-ascending")
def server_does_not_count_telemetry(patch):
    """Gives every telemetry the number 1."""
    telemetry(patch, lambda told: {"seq": 1})


@mutant("TEL-2", check=NUMBERS, code="not-in-between")
def server_tells_telemetry_by_the_time_of_day(patch):
    """Tells another clock in `telemetry` than in `pong`."""
    telemetry(patch, lambda told: {"time": time.time()})


@mutant("TEL-2", code="wrong-value", through="TEL-2")
def server_tells_a_kind_of_its_own(patch):
    """Calls a scalar a number."""

    def renamed(series):
        return series | {"kind": "number"} if series["kind"] == "scalar" else series

    telemetry(patch, lambda told: {"series": [renamed(it) for it in told["series"]]})


@mutant("TEL-3", check=ASKED, code="inherited-subscription")
def server_tells_the_next_what_one_asked_for(patch):
    """Goes on telling what a client had subscribed to, to the next that comes."""
    left: list[Any] = []

    def unsubscribe(original, self, connection):
        if connection in self.subscribers:
            left.append(self.subscribers[connection].names)
        original(self, connection)

    def handle(original, self, connection, message, *rest):
        if left and connection.has("telemetry") and connection not in self.readings.subscribers:
            self.readings.subscribe(connection, left.pop())
        return original(self, connection, message, *rest)

    Seam(Readings, "unsubscribe").wrap(patch, unsubscribe)
    server.HANDLES_MESSAGE.wrap(patch, handle)


@mutant("TEL-3", check=ASKED, code="other-series", at=server.TAKES_TELEMETRY_SUBSCRIPTION)
def server_tells_everything(original, self, connection, names):
    """Sends all series to whoever has subscribed to some."""
    original(self, connection, None)


@mutant("TEL-3", code="another-series", through="TEL-3")
def server_tells_a_series_more(patch):
    """Adds a series of its own to what was asked for."""
    added = {"name": "splats", "kind": "scalar", "value": 6.0}
    telemetry(patch, lambda told: {"series": [*told["series"], added]})


@mutant("TEL-3", check=ASKED, code="other-series", at=server.TAKES_TELEMETRY_SUBSCRIPTION)
def server_takes_no_list_of_series(original, self, connection, names):
    """Refuses a subscription that names series, so that the one before it stays in force."""
    if names is None:
        original(self, connection, names)


@mutant(
    "TEL-7",
    check="check_tells_everyone_who_subscribed",
    code="not-told",
    at=server.TAKES_TELEMETRY_SUBSCRIPTION,
)
def server_tells_only_who_wants_everything(original, self, connection, names):
    """Forgets a subscription that names its series."""
    original(self, connection, names and frozenset())
