"""Checks on time in the scene, and on the server's clock (spec 1.1 chapter 9)."""

import time

from hypothesis import strategies as st

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.images.known_scene import BOBS, COLOR_BUDGET, render
from splatbus_conformance.trials.moves.clocks import (
    ClockReading,
    expect_one_offset,
    near,
    read_clock,
    set_time,
)
from splatbus_conformance.trials.moves.image_session import ImageSession, further
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import is_number, show

ANIMATED = ("1.1", "frames", "pixels", "capability:time", "capability:scene")
PINGS = ("1.1", "capability:ping")
WHOLE = 0.99
ODD_TIMES: tuple[float, ...] = (
    *(0, -0.0, 0.1, -1.5, 12.5, 1041.375, 1e-300, 5e-324, 2**53, -(2**53), 1.7e308, 1e22),
    *(1_700_000_000.123456, 0.30000000000000004),
)


def time_range(trial: ServerTrial) -> tuple[float, float]:
    """First and last time of the scene; skips the check where it has none."""
    first_view(trial, 0.0)
    told = trial.facts.time_range()
    if told is None or not told[0] < told[1]:
        trial.not_observable("the scene has no range of times")
    return told


def inside_and_outside(trial: ServerTrial, session: ImageSession) -> Cases:
    """Times inside and outside of the range, several at once."""
    first, last = time_range(trial)
    beyond = 10.0 * (last - first) + 1.0
    times = st.floats(first, last) | st.floats(first - beyond, last + beyond)
    listed = [[0.75 * first + 0.25 * last], [last, first], [last + 1e6], [first - 1e6, first - 1.0]]
    return Cases(listed, st.lists(times, min_size=1, max_size=4), quick=6, full=500)


@check("TIM-2", on={SERVER: ANIMATED}, given=ImageSession, cases=inside_and_outside)
def check_renders_at_the_time_that_was_set(
    trial: ServerTrial, session: ImageSession, asked: list[float]
) -> None:
    """The newest of times that are set counts, and the nearest to it in the range."""
    first, last = time_range(trial)
    wanted = min(max(asked[-1], first), last)
    what = f"set_time was sent for {show(asked)}, of a scene from {first} to {last},"
    told = session.look(*map(set_time, asked)).frame.get("time")
    why = f"{what} and the next frame has time {show(told)}"
    trial.expect(near(told, wanted), "another-time", why)
    again = session.look().frame.get("time")
    why = f"{what} and then time went on to {show(again)}"
    trial.expect(near(again, wanted), "time-goes-on", why)


@check("TIM-3", on={SERVER: (*ANIMATED, "scene")})
def check_frames_tell_the_time_of_their_image(trial: ServerTrial) -> None:
    """What moves with time is where it has to be at the time that each frame tells."""
    first, last = time_range(trial)
    session, compared = ImageSession(trial), 0
    step = (last - first) / 8.0
    for number in trial.each(range(64 if trial.thorough else 8)):
        seen = session.look(set_time(first + step * (3 * number % 8) + step / (1 + number)))
        exact = render(seen.camera, trial.facts.setting(seen.frame))
        moves = exact.certain & (exact.what // 2 == BOBS)
        if moves.sum() < 10:
            continue
        right = (exact.color_error(seen.color) <= COLOR_BUDGET)[moves].mean()
        told = f"a frame has time {seen.frame['time']}, and what moves is not where it is then"
        trial.expect(right >= WHOLE, "other-pixels", told)
        compared += 1
    if not compared:
        trial.not_observable("no image showed what moves")


@check("PNG-2", on={SERVER: PINGS})
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
    readings += rendered(trial)
    expect_one_offset(trial, readings)


def rendered(trial: ServerTrial) -> list[ClockReading]:
    """When images were rendered, by their frames; none where no frame comes."""
    if not trial.facts.renders:
        return []
    reader, found = trial.reading(), []
    trial.wait(lambda: trial.with_(reader).frames)
    for _ in range(3):
        sent = time.monotonic()
        frame = trial.sees(reader, trial.move())
        if frame and is_number(frame.get("renderedAt")):
            clock = float(frame["renderedAt"])
            found.append(ClockReading(sent, clock, time.monotonic(), "renderedAt of a frame"))
    return found


@check("PNG-3", on={SERVER: PINGS})
def check_the_clock_goes_on(trial: ServerTrial) -> None:
    """Pings on two connections in turns, with frames between them: no time is before the last."""
    first = trial.greeted("msg")
    connections = [first, further(trial, first)]
    last = read_clock(trial, first, 0.0, 0)
    for number in trial.each(range(400 if trial.thorough else 40)):
        now = read_clock(trial, connections[number % 2], float(number), number)
        back = last.server - now.server
        told = f"serverTime went back by {back:.6f} s, from {last.server!r}"
        trial.expect(back <= 0, "server-time-goes-back", told)
        last = now
    rendered(trial)  # whose times the rule looks at
