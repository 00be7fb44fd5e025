"""Time in the scene, and the server's clock (spec 1.1 chapter 9)."""

import math
import time
from typing import Any, NamedTuple

from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import is_number, show, within
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

CLOSENESS = 1e-6
"""How far a time may be from the one that was set, absolute or relative: as single precision."""
TICK_SECONDS = 0.02
"""By how much a clock may step, and two clocks drift apart in a check."""


def set_time(seconds: float) -> Json:
    """The message."""
    return {"type": "set_time", "time": seconds}


def near(told: Any, wanted: float) -> bool:
    """Whether a time is the one that was set."""
    return is_number(told) and math.isclose(told, wanted, rel_tol=CLOSENESS, abs_tol=CLOSENESS)


class ClockReading(NamedTuple):
    """A server's clock, read between two moments of the harness's."""

    sent: float
    server: float
    came: float
    what: str

    @property
    def least(self) -> float:
        """By how much the server's clock is ahead, at least."""
        return self.server - self.came

    @property
    def most(self) -> float:
        """The same, at most."""
        return self.server - self.sent


def read_clock(trial: ServerTrial, connection: Connection, t: float, id: int) -> ClockReading:
    """Send a `ping`, and judge the `pong` by itself (PNG-2)."""
    sent = time.monotonic()
    told = trial.ask(connection, {"type": "ping", "t": t, "id": id}) or {}
    came = time.monotonic()
    what = f"a ping with t {show(t)} and id {id}"
    unlike = "another-answer" if told else "no-reply"
    kind, named, echo, clock = (within(told, name) for name in ("type", "id", "t", "serverTime"))
    trial.expect(kind == "pong", unlike, f"{what} was answered by {show(kind)}")
    trial.expect(named == id, "wrong-id", f"{what}: the id of pong is {show(named)}")
    same = is_number(echo) and float(echo) == float(t)
    trial.expect(same, "not-echoed", f"{what}: t of pong is {show(echo)}")
    trial.expect(is_number(clock), "no-server-time", f"{what}: serverTime is {show(clock)}")
    return ClockReading(sent, float(clock), came, what)


def expect_one_offset(trial: ServerTrial, readings: list[ClockReading]) -> None:
    """Some offset of the server's clock is possible by all readings."""
    least, most = max(it.least for it in readings), min(it.most for it in readings)
    if least > most + TICK_SECONDS:
        early = max(readings, key=lambda it: it.least)
        late = min(readings, key=lambda it: it.most)
        trial.violated(
            "not-in-between",
            f"{early.what}: the server's clock is at least {early.least:.6f} s ahead, and by"
            f" {late.what} at most {late.most:.6f} s: one of them was not read in between",
        )
