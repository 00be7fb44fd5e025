"""Checks on frames in device memory (spec 1.1 chapters 4 and 5)."""

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.memory.cuda_stand_in import publishing
from splatbus_conformance.images.memory.cuda_stand_in.session import SLOW_RECORDS
from splatbus_conformance.trials.moves.announced import (
    AnnouncedConnection,
    announced,
    calls_of,
    expect_kept,
)
from splatbus_conformance.trials.moves.frame_readers import answer_and_leave
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import whole

LENDS = ("1.1", "stand-in", "capability:cuda_ipc", "capability:frames", "frames")
FRAMES = 20
REST_SECONDS = 0.05


@check("IMG-7", observable="when a slot is written and its event recorded", on={SERVER: LENDS})
def check_records_the_event_before_the_frame(trial: ServerTrial) -> None:
    """The server is launched anew with a runtime whose records take 5 milliseconds, so that one
    which is made after the frame was sent comes after the frame has arrived.
    """
    with trial.relaunched(**SLOW_RECORDS):
        connection = trial.reading()
        shown = announced(trial, connection)
        frames = trial.viewer.with_(connection).frames
        for _ in trial.each(range(100 if trial.thorough else FRAMES)):
            before = len(frames)
            trial.move()
            trial.grows(connection, frames, before)
        trial.rest(REST_SECONDS)
        if not frames:
            trial.not_observable("the server sent no frame")
        for frame, at in zip(frames, arrivals(trial, shown), strict=True):
            slot = whole(frame.get("slot"), 0) or 0
            planes = publishing.slot_planes(shown.packet, slot)
            event = shown.names.get(f"ring.events[{slot}]", "")
            calls = (call for call in calls_of(trial, shown.process) if call.time <= at)
            if found := publishing.moments(calls, event, planes):
                told = f"when frame {frame.get('seq')} came, the event of slot {slot} was not"
                told += f" recorded behind the last write to it, {found[-1].call}"
                trial.expect(not found[-1].open, "event-not-recorded", told)
                trial.delivered += 1
    if not trial.delivered:
        trial.not_observable("no call of the runtime wrote to the slots")


def arrivals(trial: ServerTrial, shown: AnnouncedConnection) -> list[float]:
    """When each frame had arrived."""
    connection = shown.connection
    return [connection.arrived(it) for it in connection.messages if it.type == "frame"]


@check("OPN-8", observable="the calls that free, while a ring is open", on={SERVER: LENDS})
def check_keeps_the_ring_while_somebody_has_it(trial: ServerTrial) -> None:
    """One reader has opened the ring. Others open it, close it, fail to, and leave."""
    shown = announced(trial, trial.reading())
    for answer in trial.each(("closed", "open_failed", "opened")):
        answer_and_leave(trial, trial.reading(), shown.packet.get("generation"), answer)
        ring = [place for place in shown.names if place.startswith(("memory", "ring"))]
        expect_kept(trial, shown, ring)
        trial.delivered += 1
