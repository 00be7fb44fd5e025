"""Checks on what a server does with device memory (spec 1.0 sections 5.4 and 5.5).

The stand-in CUDA runtime tells what the server called; the harness plays clients of 1.0.
"""

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.memory.cuda_stand_in import publishing
from splatbus_conformance.trials.moves.announced import (
    announced,
    calls_of,
    expect_kept,
)
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS

SHOWN = ("cuda", "stand-in")
EVENT_FLAGS = {4: "cudaEventInterprocess", 2: "cudaEventDisableTiming"}
MOVES, MOVE_SECONDS = 10, 0.05
LEFT_OPEN = 0.9
"""The share of the time from which an event is held to be recorded before the image, not after."""
SURE, WATCHES = 20, 10
"""Writes and records from which that share can be told; how often more of them are waited for."""


def watch(trial: ServerTrial) -> None:
    """Have the server render for some time."""
    for _ in range(MOVES):
        trial.move()
        trial.rest(MOVE_SECONDS)


@check("BUF-10", on={SERVER: SHOWN})
def check_records_the_event_after_the_image(trial: ServerTrial) -> None:
    """The camera is moved, and left alone. The last write to each plane must come to have a record
    behind it, on its stream or one that is ordered after it, within 5 seconds; and while images
    follow each other, not only when the next is about to be written.
    """
    shown = announced(trial)
    planes, event = publishing.legacy_planes(shown.packet), shown.names.get("evt_done", "")
    if len(planes) < len(publishing.OFFSETS) or not event:
        trial.not_observable("its handles are none of the stand-in")

    def found() -> list[publishing.Moment]:
        return publishing.moments(calls_of(trial, shown.process), event, planes)

    watch(trial)
    seen = found()
    if not any(moment.written for moment in seen):
        trial.not_observable("no call of the runtime wrote to its images")
    first = next((moment for moment in seen if moment.recorded and moment.written), None)
    if first and first.written != planes.keys():
        what = " and ".join(sorted(first.written))
        trial.violated(
            "recorded-too-early", f"it called {first.call} when it had written the {what} only"
        )
    for _ in range(WATCHES):
        if len(seen) >= SURE or not any(moment.recorded for moment in seen):
            break
        watch(trial)  # of a server, or on a machine, that is slow
        seen = found()
    share = publishing.share_left_open(seen, planes)
    if share >= LEFT_OPEN and len(seen) >= SURE:
        trial.violated(
            "recorded-too-late",
            f"for {share:.0%} of the time an image lay there without the event recorded behind it;"
            f" {last_record(seen)}",
        )
    known = len(seen) - 1
    if not trial.wait(lambda: any(not moment.open for moment in found()[known:])):
        seen = found()
        last = next(moment.call for moment in reversed(seen) if not moment.recorded)
        trial.violated(
            "event-not-recorded",
            f"in {EFFECT_SECONDS:g} s the event was not once seen recorded behind the last write of"
            f" the {' and '.join(sorted(seen[-1].open))}, {last}; {last_record(seen)}",
        )


def last_record(seen: list[publishing.Moment]) -> str:
    """The last record of the event, in words."""
    calls = [moment.call for moment in seen if moment.recorded]
    return f"its last record is {calls[-1]}" if calls else "it was never recorded"


@check("CUD-1", on={SERVER: SHOWN})
def check_exports_nothing_but_buffers(trial: ServerTrial) -> None:
    """Copies into and out of exported memory that are of no image; handles that were refused, as
    those of memory are that cudaMalloc did not make.
    """
    shown = announced(trial)
    watch(trial)
    if "mem_color" not in shown.names or "mem_depth" not in shown.names:
        refuse(trial, "cudaIpcGetMemHandle", "memory that cannot be exported")
    calls = calls_of(trial, shown.process)
    for call in publishing.beside(calls, publishing.planes_of(shown.packet)):
        trial.violated(
            "more-than-images", f"the memory that it shows holds something else than images: {call}"
        )


@check("CUD-3", on={SERVER: SHOWN})
def check_creates_the_event_with_its_flags(trial: ServerTrial) -> bool:
    """Every event of which the server asked for a handle, whether or not it got one."""
    shown = announced(trial)
    flags: dict[str, int] = {}
    exported = False
    for call in calls_of(trial):
        if call.function == "cudaEventCreate":
            flags[call.event] = call.flags
            for bit, name in EVENT_FLAGS.items():
                right = call.ok or not call.flags & 4 or call.flags & bit
                trial.expect(right, "missing-flag", f"without {name} it called {call}")
        elif call.function == "cudaIpcGetEventHandle":
            exported |= call.ok
            for bit, name in EVENT_FLAGS.items():
                right = flags.get(call.event, bit) & bit
                told = f"without {name} it created the event of {call}"
                trial.expect(right, "missing-flag", told)
    if "evt_done" not in shown.names:
        refuse(trial, "cudaIpcGetEventHandle", "an event that cannot be exported")
    return exported


def refuse(trial: ServerTrial, function: str, what: str) -> None:
    """The handle is not the runtime's: violated if it refused one, else nothing can be said."""
    for call in calls_of(trial):
        if call.function == function and not call.ok:
            trial.violated("not-exportable", f"it asked for the handle of {what}: {call}")
    trial.not_observable("its handles are none of the stand-in")


@check("CUD-4", on={SERVER: SHOWN})
def check_keeps_memory_while_a_connection_is_open(trial: ServerTrial) -> None:
    """One client stays on the IPC channel. Others come and go beside it, on both channels: close,
    are reset, ask, pose, leave a packet unfinished.
    """
    shown = announced(trial)
    if not shown.names:
        trial.not_observable("its handles are none of the stand-in")
    for visit in trial.each(VISITS):
        if shown.connection.ended:
            shown = announced(trial)
        visit(trial)
        trial.rest(MOVE_SECONDS)
        expect_kept(trial, shown)


def asks(trial: ServerTrial) -> None:
    """Poses the camera and asks, then leaves."""
    trial.move()
    connection = trial.dial("msg")
    trial.answers(connection)
    trial.peer.pump()
    for each in trial.peer.connections:
        if each.channel == "msg":
            each.close()


def closes(trial: ServerTrial) -> None:
    """Takes an init packet, and closes."""
    announced(trial).connection.close()


def resets(trial: ServerTrial) -> None:
    """Takes an init packet, and resets the connection."""
    announced(trial).connection.reset()


def half(trial: ServerTrial) -> None:
    """Leaves in the middle of a packet."""
    connection = trial.dial("ipc")
    connection.send(b"\x05\0\0\0{")
    connection.close()


def twice(trial: ServerTrial) -> None:
    """Two at a time; the first is the last to go."""
    first, second = trial.dial("ipc"), trial.dial("ipc")
    announced(trial, second)
    second.close()
    trial.rest(MOVE_SECONDS)
    first.close()


VISITS = (asks, closes, resets, half, twice)
