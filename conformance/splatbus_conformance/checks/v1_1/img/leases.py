"""Checks on leases: what readers do with them, and what a server may make of it (section 5.2)."""

import time

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.text import broken_texts
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.moves.frame_readers import (
    LENDS,
    beside,
    contents,
    following,
    holding,
    joined,
    lent,
    memory_of,
    pause_for_an_image,
    pinning,
)
from splatbus_conformance.trials.moves.survey import alike, first_view, likeness, moves
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

SAFE: int = LIMITS["max_safe_integer"]
GLANCE_SECONDS = 0.05
SPARE = 6
"""Broken texts that the quick profile delivers beside one of each kind."""
MOST_READERS = 24
"""Readers that a check connects at most, where a server takes them all."""
MOST_LEASES = 64
"""Connections that a check ends at most while they hold a lease."""


@check("IMG-9", on={SERVER: LENDS})
def check_waits_for_no_reader(trial: ServerTrial) -> None:
    """One reader never answers the init packet, one or two hold a frame, and one reads on."""
    trial.viewer.opens = False
    silent = trial.greeted("ipc")
    trial.viewer.opens = True
    first, held = holding(trial)
    others = [silent, first]
    with trial.viewer.holding():
        second, _ = trial.answered("ipc")
    trial.grows(second, trial.with_(second).frames)
    others += [] if second.ended else [second]
    reader = beside(trial, *others)
    for place in trial.each(range(20)):
        pose = trial.move()
        seen = trial.sees(reader, pose)
        trial.expect(
            seen, "no-frame", f"move {place + 1} was not seen while {len(others)} others stalled"
        )
    trial.viewer.release(first, held)
    trial.expect(
        trial.sees(first, pose),
        "no-frame-after-pause",
        "a reader that goes on after a pause is sent nothing",
    )


def held_by(trial: ServerTrial, reader: Connection) -> tuple[bytes, bytes]:
    """Colour and depth of the image that a reader holds."""
    dealings = trial.with_(reader)
    assert dealings.held is not None
    return contents(memory_of(trial, reader), int(dealings.held["slot"]))


@check(
    "IMG-4",
    on={SERVER: (*LENDS, "pixels")},
)
def check_what_two_hold_is_not_written(trial: ServerTrial) -> None:
    """Two readers hold an image each, and not the same, while a third is shown others until the
    ring has gone round.
    """
    holders = [first := trial.reading(), beside(trial, first)]
    if not all(pinning(trial, it) for it in holders):
        trial.not_observable("a reader was sent no frame of the newest pose")
    reader = beside(trial, *holders)
    slots = memory_of(trial, reader).layout.slots
    before = [held_by(trial, it) for it in holders]
    for _ in trial.each(range(3 * min(slots, MOST_READERS))):
        if trial.sees(reader, trial.move()) is None:
            trial.not_observable("no frame of the newest pose came beside two that are held")
    for number, it in enumerate(holders):
        told = f"two readers hold an image each, and that of the {('first', 'second')[number]}"
        trial.expect(
            held_by(trial, it) == before[number],
            "written-while-held",
            f"{told} was written meanwhile",
        )


@check("IMG-5", on={SERVER: (*LENDS, "pixels")})
def check_every_slot_shows_the_same(trial: ServerTrial) -> None:
    """Readers hold an image each, one after the other, so that images come to lie in slots that are
    seldom used; in each of them a pose looks as it did.
    """
    capture, around = FrameCapture(trial), moves(first_view(trial, 0.0))
    here, there = around[0], around[-1]
    seen: dict[int, list[CapturedFrame]] = {}
    for _ in trial.each(range(min(capture.slots, MOST_READERS))):
        for _ in range(2):
            capture.take(there)
            image = capture.take(here)
            seen.setdefault(int(image.frame["slot"]), []).append(image)
        further, _ = trial.answered("ipc")
        if not lent(trial, further) or capture.reader.ended:
            break
    first, *others = (images[0] for images in seen.values())
    times = {it.frame.get("time") for images in seen.values() for it in images}
    same = all(alike(images[0], it) for images in seen.values() for it in images[1:])
    if len(times) > 1 or not same:
        trial.not_observable("the scene moves by itself")
    for other in others:
        slots = other.frame["slot"], first.frame["slot"]
        trial.expect(
            alike(first, other),
            "other-pixels",
            f"{1 - likeness(first, other):.0%} of the pixels in slot {slots[0]} are others than in"
            f" slot {slots[1]}, though both show a camera at {here}",
        )


@check("IMG-16", on={SERVER: LENDS})
def check_ignores_release_of_what_is_not_held(trial: ServerTrial) -> None:
    """Releases of other images, of other generations, and of what has been released already."""
    numbers = st.tuples(st.sampled_from(("seq", "generation", "twice")), st.integers(1, SAFE))
    pause = pause_for_an_image(trial, GLANCE_SECONDS)
    connection, held = holding(trial)
    for kind, number in trial.each(drawn=numbers, quick=10, full=500):
        if connection.ended:
            connection, held = holding(trial)
        frames, errors = trial.with_(connection).frames, trial.with_(connection).errors()
        wrong = dict(held)
        if kind == "twice":
            pose = trial.move()
            trial.rest(pause)
            trial.viewer.release(connection, held)
            held = following(trial, connection, pose) or trial.violated(
                "no-frame", "no frame after release"
            )
        elif number != held[kind]:
            wrong[kind] = number
        else:
            continue
        what = f"release of image {wrong['seq']} of generation {wrong['generation']}"
        told = f"{what} while {held['seq']} of {held['generation']} is held"
        before = len(frames)
        trial.viewer.release(connection, wrong)
        pose = trial.move()
        trial.rest(pause)
        trial.expect(len(frames) == before, "another-frame", f"{told}: another frame came")
        trial.viewer.release(connection, held)
        seen = following(trial, connection, pose)
        if seen is None:
            trial.judge(trial.fate() or ("closes" if connection.ended else "hangs"), told)
        else:
            reported = len(trial.with_(connection).errors()) > len(errors)
            trial.judge("reports" if reported else "ignores", told)
            held = seen


@check("IMG-17", on={SERVER: LENDS})
def check_ends_leases_with_the_connection(trial: ServerTrial) -> None:
    """More readers than there are slots hold an image each and leave, in three ways."""
    slots = memory_of(trial, trial.reading()).layout.slots
    trial.peer.close_all()
    for number in trial.each(range(min(slots, MOST_LEASES) + 2)):
        reader = patient_reader(trial, number)
        seen = pinning(trial, reader)
        trial.expect(seen, "no-frame", f"{number} readers left with a lease; the next saw no move")
        leave(trial, reader, number)


def patient_reader(trial: ServerTrial, former: int) -> Connection:
    """A reader that tries again while it is refused: its server may not know yet who has left."""
    found: list[Connection | None] = []

    def welcomed() -> bool:
        found.append(joined(trial))
        return found[-1] is not None

    trial.peer.until(welcomed, EFFECT_SECONDS)
    return found[-1] or trial.violated(
        "refused", f"{former} readers left with a lease; the next was refused"
    )


def leave(trial: ServerTrial, connection: Connection, way: int) -> None:
    """End a connection, by a close, a reset or a half-close."""
    if way % 3 == 0:
        connection.close()
    elif way % 3 == 1:
        connection.reset()
    else:
        connection.end_stream()
        trial.wait(lambda: connection.ended)
        connection.close()


@check(
    "IMG-18",
    on={SERVER: LENDS},
)
def check_refuses_readers_that_it_has_no_slot_for(trial: ServerTrial) -> None:
    """Readers connect, and each holds an image of its own, until one is refused."""
    readers: list[Connection] = []
    for number in range(MOST_READERS):
        connection, answer = trial.answered("ipc")
        dealings = trial.with_(connection)
        if any(reader.ended for reader in readers):
            trial.not_observable("the server ends a connection in favour of a later one")
        if answer is None:
            trial.expect(
                connection.ended, "no-reply", f"beside {number} readers a hello is not answered"
            )
            trial.not_observable(f"it takes no connection beside {number} readers")
        told = f"reader {number + 1}, while {number} hold an image each,"
        if lent(trial, connection):
            trial.expect(pinning(trial, connection), "no-frame", f"{told} was lent none of its own")
            readers.append(connection)
            continue
        trial.expect(dealings.welcome, "no-welcome", f"{told} was given no welcome")
        codes = dealings.errors()
        trial.expect(
            "too_many_clients" in codes,
            "another-error" if codes else "no-error",
            f"{told} was told {', '.join(codes) or 'nothing'}",
        )
        trial.judge("closes" if trial.ends(connection) else "waits", told)
        seen = following(trial, readers[-1], trial.move())
        trial.expect(
            seen, "no-frame-after-refusal", f"after {told[:-1]} was refused, another saw no move"
        )
        return
    trial.not_observable(f"it serves {MOST_READERS} readers at a time")


@check(
    "JSN-8",
    on={SERVER: LENDS},
    may_crash=True,
)
def check_does_not_release_by_broken_text(trial: ServerTrial) -> bool:
    """A `release` whose text breaks JSN-1 to JSN-5, while a newer image is to be had."""
    goes_on = False
    connection, held, pace = _taking_turns(trial)
    kinds = [text.kind for text in broken_texts(_receipt(held))]
    for place in trial.each(range(len(kinds)), kind=kinds.__getitem__, spare=SPARE):
        if connection.ended:
            connection, held, pace = _taking_turns(trial)
        frames, text = trial.with_(connection).frames, broken_texts(_receipt(held))[place]
        before, pose = len(frames), trial.move()
        connection.send(packet(text.payload))
        trial.rest(GLANCE_SECONDS + 2 * pace)
        told = f"a release with {text.what} ({text.requirement})"
        trial.expect(len(frames) == before, "another-frame", f"{told}: another frame came")
        if connection.ended:
            continue  # as it may be
        trial.viewer.release(connection, held)
        seen = following(trial, connection, pose)
        if seen is None:
            trial.judge(trial.fate() or ("closes" if connection.ended else "hangs"), told)
            continue
        held, goes_on = seen, True
    return goes_on


def _taking_turns(trial: ServerTrial) -> tuple[Connection, Json, float]:
    """A new reader, the frame that it holds, and the seconds that passed from the release of the
    one before to it.
    """
    connection, held = holding(trial)
    pose, began = trial.move(), time.monotonic()
    trial.viewer.release(connection, held)
    newer = following(trial, connection, pose)
    if newer is None:
        trial.not_observable("no frame follows a release")
    return connection, newer, time.monotonic() - began


def _receipt(held: Json) -> Json:
    return {"type": "release", "generation": held["generation"], "seq": held["seq"]}
