"""Checks on time in the scene, and on the server's clock (spec 1.1 chapter 9)."""

import math
import time
from typing import Any, NamedTuple

import numpy as np
from hypothesis import strategies as st

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.known_scene import BOBS, COLOR_BUDGET, render
from splatbus_conformance.trials.moves.frame_readers import frames_of
from splatbus_conformance.trials.moves.image_session import ImageSession, further
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import is_number, show
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

ANIMATED = ("1.1", "frames", "pixels", "capability:time", "capability:scene")
PINGS = ("1.1", "capability:ping")
CLOSENESS = 1e-6
"""How far a time may be from the one that was set, absolute or relative: as single precision."""
WHOLE = 0.99
TICK_SECONDS = 0.02
"""By how much a clock may step, and two clocks drift apart in a check."""
ODD_TIMES: tuple[float, ...] = (
    *(0, -0.0, 0.1, -1.5, 12.5, 1041.375, 1e-300, 5e-324, 2**53, -(2**53), 1.7e308, 1e22),
    *(1_700_000_000.123456, 0.30000000000000004),
)


def set_time(seconds: float) -> Json:
    """The message."""
    return {"type": "set_time", "time": seconds}


def times(first: float, last: float) -> st.SearchStrategy[float]:
    """Times of a scene, some of them outside of it."""
    beyond = 10.0 * (last - first) + 1.0
    return st.floats(first, last) | st.floats(first - beyond, last + beyond)


@check("TIM-2", observable="the time of the frames that follow", on={SERVER: ANIMATED})
def check_renders_at_the_time_that_was_set(trial: ServerTrial) -> None:
    """Times inside and outside of the range, several at once, of which the newest counts."""
    first, last = time_range(trial)
    image_session = ImageSession(trial)
    listed = [[0.75 * first + 0.25 * last], [last, first], [last + 1e6], [first - 1e6, first - 1.0]]
    drawn = st.lists(times(first, last), min_size=1, max_size=4)
    for asked in trial.each(listed, drawn, quick=6, full=500):
        seen = image_session.look(*map(set_time, asked))
        wanted = min(max(asked[-1], first), last)
        told = seen.frame.get("time")
        what = f"set_time was sent for {show(asked)}, of a scene from {first} to {last},"
        trial.expect(
            _near(told, wanted), "another-time", f"{what} and the next frame has time {show(told)}"
        )
        again = image_session.look().frame.get("time")
        trial.expect(
            _near(again, wanted), "time-goes-on", f"{what} and then time went on to {show(again)}"
        )
        trial.delivered += 1


@check("TIM-3", observable="every pixel of an animated scene", on={SERVER: (*ANIMATED, "scene")})
def check_frames_tell_the_time_of_their_image(trial: ServerTrial) -> None:
    """What moves with time is where it has to be at the time that each frame tells."""
    first, last = time_range(trial)
    image_session, compared = ImageSession(trial), 0
    step = (last - first) / 8.0
    for number in trial.each(range(64 if trial.thorough else 8)):
        seen = image_session.look(set_time(first + step * (3 * number % 8) + step / (1 + number)))
        exact = render(seen.camera, trial.facts.setting(seen.frame))
        moves = exact.certain & (exact.what // 2 == BOBS)
        if moves.sum() < 10:
            continue
        right = (exact.color_error(seen.color) <= COLOR_BUDGET)[moves].mean()
        told = f"a frame has time {seen.frame['time']}"
        trial.expect(
            right >= WHOLE,
            "other-pixels",
            f"{told}, and what moves is not where it is at that time",
        )
        compared += 1
        trial.delivered += 1
    if not compared:
        trial.not_observable("no image showed what moves")


def time_range(trial: ServerTrial) -> tuple[float, float]:
    """First and last time of the scene; skips the check where it has none."""
    first_view(trial, 0.0)
    told = trial.facts.time_range()
    if told is None or not told[0] < told[1]:
        trial.not_observable("the scene has no range of times")
    return told


def _near(told: Any, wanted: float) -> bool:
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
    trial.expect(
        told.get("type") == "pong", unlike, f"{what} was answered by {show(told.get('type'))}"
    )
    trial.expect(
        told.get("id") == id, "wrong-id", f"{what}: the id of pong is {show(told.get('id'))}"
    )
    same = is_number(told.get("t")) and float(told["t"]) == float(t)
    trial.expect(same, "not-echoed", f"{what}: t of pong is {show(told.get('t'))}")
    clock = told.get("serverTime")
    if not isinstance(clock, int | float) or isinstance(clock, bool):
        trial.violated("no-server-time", f"{what}: serverTime is {show(clock)}")
    return ClockReading(sent, float(clock), came, what)


@check("PNG-2", observable="the pong, and its time between the ping and itself", on={SERVER: PINGS})
def check_pong_tells_the_clock(trial: ServerTrial) -> None:
    """Pings with odd times, now and a while later: one offset of the clocks explains all of them,
    and `renderedAt` of frames too.
    """
    connection = trial.greeted("msg")
    numbers = st.floats(allow_nan=False, allow_infinity=False)
    readings = []
    for number, t in enumerate(trial.each(ODD_TIMES, numbers, quick=10, full=2000)):
        readings.append(read_clock(trial, connection, t, number))
        trial.rest(0.005 * (number % 3))
        expect_one_offset(trial, readings)
        trial.delivered += 1
    if trial.facts.renders:
        readings += rendered(trial)
        expect_one_offset(trial, readings)


def rendered(trial: ServerTrial) -> list[ClockReading]:
    """When images were rendered, by their frames."""
    reader, found = trial.reading(), []
    trial.wait(lambda: frames_of(trial, reader))
    for _ in range(3):
        sent = time.monotonic()
        frame = trial.sees(reader, trial.move())
        if frame and is_number(frame.get("renderedAt")):
            clock = float(frame["renderedAt"])
            found.append(ClockReading(sent, clock, time.monotonic(), "renderedAt of a frame"))
    return found


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


@check("PNG-3", observable="the order of times in pongs and frames", on={SERVER: PINGS})
def check_the_clock_goes_on(trial: ServerTrial) -> None:
    """Pings on two connections in turns, with frames between them: no time is before the last."""
    first = trial.greeted("msg")
    connections = [first, further(trial, first)]
    last = read_clock(trial, connections[0], 0.0, 0)
    for number in trial.each(range(400 if trial.thorough else 40)):
        now = read_clock(trial, connections[number % 2], float(number), number)
        trial.expect(
            now.server >= last.server,
            "server-time-goes-back",
            f"serverTime went back by {last.server - now.server:.6f} s, from {last.server!r}",
        )
        last = now
        trial.delivered += 1
    if trial.facts.renders:
        told = [it.server for it in rendered(trial)]
        trial.expect(
            bool(np.all(np.diff(told) >= 0)),
            "rendered-at-goes-back",
            f"renderedAt went back: {told}",
        )
