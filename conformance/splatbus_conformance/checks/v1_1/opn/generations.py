"""Checks on memory that was replaced when images changed their size (spec 1.1 chapters 4, 8)."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.checks.v1_1.cam.lenses import in_force, lens_of, scaled
from splatbus_conformance.checks.v1_1.cam.resized import Sitting, other, sitting
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.memory.reading import LINUX_FOLDER, Opened
from splatbus_conformance.trials.moves.frame_readers import beside, fell_silent, holding
from splatbus_conformance.trials.moves.image_session import elsewhere
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    Size,
    changed,
    dealings_of,
    other_sizes,
    readers,
    resizing,
    told_at,
)
from splatbus_conformance.trials.moves.survey import WHOLE, first_view, likeness
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_values import whole
from splatbus_conformance.wire.messages import Json, says_of
from splatbus_conformance.wire.sockets import Connection

FREE_SECONDS: float = LIMITS["free_seconds"]
LET_GO_SECONDS: float = LIMITS["let_go_seconds"]
SLOW_SECONDS = 0.4
"""How long a reader takes that is slow to open memory."""
SOON = 0.5
"""A server that closes a client so much sooner than it may is not merely inexact."""


def shared(trial: ServerTrial, memory: Opened) -> Path:
    """The file that shared memory is; skips the check where that cannot be seen."""
    path = LINUX_FOLDER / memory.name
    if not path.exists():
        trial.not_observable("its memory is not listed by the system")
    return path


def memory_of(trial: ServerTrial, connection: Connection) -> Opened:
    """What a reader has open."""
    memory = dealings_of(trial, connection).memory
    if memory is None:
        trial.not_observable("a reader has no memory open")
    return memory


@check(
    "VPT-7",
    observable="when the name of former memory is gone",
    on={SERVER: (*RESIZES, "opens")},
    given=resizing,
    cases=lambda trial, _: Cases(list(enumerate(other_sizes(trial)[:2]))),
)
def check_frees_former_memory(
    trial: ServerTrial, client: Connection, case: tuple[int, Size]
) -> None:
    """Up to three readers open other memory; one closes what it had, one's connection ends, and
    the last closes it too, or says that it could not open it.
    """
    fails, size = case
    everyone = readers(trial)
    path = shared(trial, memory_of(trial, everyone[0]))
    for reader in everyone:
        dealings_of(trial, reader).keeps = True
    changed(trial, client, size)
    last, *others = everyone
    told = trial.wait(lambda: all(dealings_of(trial, it).kept for it in everyone), REINIT_SECONDS)
    trial.expect(
        told, "no-init-packet", "a reader was sent no further init packet within 5 s (VPT-5)"
    )
    for each in others[::2]:
        each.close()
    for each in others[1::2]:
        trial.viewer.let_go(each)
    if fails:
        former = dealings_of(trial, last).kept[0].generation
        trial.viewer.say(last, says_of(former, "open_failed"))
    else:
        trial.viewer.let_go(last)
    gone = trial.wait(lambda: not path.exists(), FREE_SECONDS)
    trial.expect(
        gone,
        "memory-left-behind",
        f"nobody has former memory open any more, and {path.name} is there",
    )
    trial.delivered += 1
    for reader in everyone:
        reader.close()


@check(
    "OPN-8",
    observable="former memory, and an image in it, until its reader closes it",
    on={SERVER: (*RESIZES, "opens")},
    given=resizing,
)
def check_keeps_former_memory_until_it_is_closed(trial: ServerTrial, client: Connection) -> None:
    """A reader holds an image while the size changes and others follow; nobody may touch what it
    reads, and images of the new size are whole.
    """
    holder, frame = holding(trial)
    dealings = dealings_of(trial, holder)
    dealings.keeps = True
    memory, other = memory_of(trial, holder), beside(trial, holder)
    path, slot = shared(trial, memory), int(frame["slot"])
    held = memory.color(slot).tobytes(), memory.depth(slot).tobytes()
    changed(trial, client, other_sizes(trial)[1])
    trial.wait(lambda: dealings.kept or holder.ended, REINIT_SECONDS)
    for number in trial.each(range(10)):
        if holder.ended or time.monotonic() - told_at(holder) > LET_GO_SECONDS / 2:
            break  # who renders slowly may close it soon
        trial.sees(other, trial.move())
        told = f"after {number + 1} images of the new size, with an older one still held"
        trial.expect(path.exists(), "memory-gone", f"{told}, {path.name} is gone")
        same = held == (memory.color(slot).tobytes(), memory.depth(slot).tobytes())
        trial.expect(same, "written-while-held", f"{told}, that one is another")
        trial.delivered += 1
    dealings.holds = False
    trial.viewer.let_go(holder)
    seen = trial.sees(holder, trial.move())
    late = holder.ended and time.monotonic() - told_at(holder) > LET_GO_SECONDS / 2
    trial.expect(seen or late, "no-frame", "once it had closed former memory, a reader saw no move")


@check(
    "OPN-8",
    observable="former memory while a reader has not answered its init packet",
    on={SERVER: (*RESIZES, "opens")},
    given=resizing,
)
def check_keeps_former_memory_for_who_may_open_it(trial: ServerTrial, client: Connection) -> None:
    """A reader is sent an init packet and says nothing, as one that is slow to open it; the size
    changes, and it goes.
    """
    reader = trial.reading()
    path = shared(trial, memory_of(trial, reader))
    trial.viewer.opens = False
    slow = trial.greeted("ipc")
    dealings = dealings_of(trial, slow)
    trial.wait(lambda: dealings.init_packets or slow.ended)
    if slow.ended or reader.ended or not dealings.init_packets:
        trial.not_observable("the server announces its memory to one reader at a time")
    trial.viewer.opens = True
    changed(trial, client, other_sizes(trial)[0])
    trial.wait(lambda: len(dealings_of(trial, reader).init_packets) > 1, REINIT_SECONDS)
    trial.wait(lambda: not path.exists(), 10 * SLOW_SECONDS if trial.thorough else SLOW_SECONDS)
    there = path.exists()
    trial.expect(
        there, "memory-gone", f"{path.name} is gone, which a reader was told of and may open"
    )
    slow.close()
    trial.delivered += 1


@check(
    "IMG-5",
    observable="every pixel of images of other sizes",
    on={SERVER: (*RESIZES, "pixels")},
    given=sitting,
    cases=other(3),
)
def check_images_of_another_size_are_right(trial: ServerTrial, given: Sitting, size: Size) -> None:
    """The size changes, while a reader looks on: each image is of the camera that it names."""
    client, capture = given
    changed(trial, client, size, capture.reader)
    seen = capture.take(elsewhere(trial), None)
    if seen.color.shape[:2] != size[::-1]:
        fell_silent(trial, capture.reader, "the server sent no image of the new size")
    if trial.facts.scene_known:
        exact = render(seen.camera, trial.facts.setting(seen.frame))
        right = exact.agreement(seen.color, seen.planar())
    else:
        capture.take(elsewhere(trial), None)
        again = capture.take(seen.pose, None)
        right = likeness(seen, again)
        if right < WHOLE and any(
            likeness(again, it) < WHOLE for it in capture.stay(REACTION_SECONDS)
        ):
            trial.not_observable("the scene moves by itself")
    told = f"{1 - right:.0%} of the pixels of an image of {size[0]}×{size[1]}"
    trial.expect(right >= WHOLE, "other-pixels", f"{told} are not what its camera sees")
    trial.delivered += 1


@contextmanager
def through_a_lens(trial: ServerTrial) -> Iterator[tuple[Sitting, Json]]:
    """Who changes the size and who reads, and the intrinsics that images have."""
    lens = lens_of(first_view(trial, 0.0), *trial.facts.size, 1.25, 0.75, 0.1, -0.1)
    with sitting(trial) as it:
        it.capture.take(elsewhere(trial), None, intrinsics=lens)
        yield it, lens


@check(
    "CAM-5",
    observable="the camera of frames of another size",
    on={SERVER: (*RESIZES, "pixels", "capability:intrinsics")},
    given=through_a_lens,
    cases=lambda trial, _: Cases([*other_sizes(trial)[:3], trial.facts.size]),
)
def check_lenses_are_scaled_to_another_size(
    trial: ServerTrial, given: tuple[Sitting, Json], size: Size
) -> None:
    """Intrinsics are sent for images of one size, and then that changes, also to other shapes."""
    (client, capture), lens = given
    changed(trial, client, size, capture.reader)
    wrong = in_force(capture.take(elsewhere(trial), None).frame, scaled(lens, size))
    told = f"after intrinsics for {trial.facts.size} images became {size}"
    trial.expect(not wrong, "other-intrinsics", f"{told}: {wrong}")
    trial.delivered += 1


@check(
    "OPN-14",
    observable="frames of the next generation without a release",
    on={SERVER: RESIZES},
    given=resizing,
    cases=lambda trial, _: Cases(
        list(zip(("closed", "open_failed"), other_sizes(trial), strict=False))
    ),
)
def check_closed_ends_the_lease(
    trial: ServerTrial, client: Connection, case: tuple[str, Size]
) -> None:
    """A reader holds a frame when the size changes, opens the new memory, and says of the old that
    it has closed it, or that it could not open it; it never releases the frame.
    """
    answer, size = case
    holder, frame = holding(trial)
    trial.viewer.opens, dealings = False, dealings_of(trial, holder)
    had = len(dealings.init_packets)
    changed(trial, client, size, holder)
    came = len(dealings.init_packets) > had
    trial.expect(came, "no-init-packet", "no further init packet came within 5 s (VPT-5)")
    generation = whole(dealings.init_packets[-1].get("generation"))
    trial.viewer.say(holder, says_of(frame["generation"], answer), says_of(generation, "opened"))
    before = len(dealings.frames)
    trial.move()
    trial.expect(
        trial.wait(lambda: len(dealings.frames) > before),
        "no-frame",
        f"a reader said {answer} of memory in which it held a frame, and is sent none of"
        " the memory that it has opened since",
    )
    holder.close()
    trial.viewer.opens = True
    trial.delivered += 1


@check(
    "VPT-8",
    observable="when readers that keep former memory are closed",
    on={SERVER: RESIZES},
    given=resizing,
)
def check_closes_who_does_not_let_go(trial: ServerTrial, client: Connection) -> None:
    """A reader opens other memory and never closes what it had, and one never says whether it had
    opened that, beside one that lets go.
    """
    keeper = trial.reading()
    dealings_of(trial, keeper).keeps = True
    other = beside(trial, keeper)
    trial.viewer.opens = False
    silent = trial.greeted("ipc", capabilities=["host_shm", "cuda_ipc", "reinit"])
    trial.wait(lambda: dealings_of(trial, silent).init_packets or silent.ended)
    trial.viewer.opens = True
    if keeper.ended or other.ended:
        trial.not_observable("the server ends a reader for a further one")
    late = [keeper, silent] if dealings_of(trial, silent).init_packets else [keeper]
    changed(trial, client, other_sizes(trial)[0])
    trial.wait(lambda: dealings_of(trial, keeper).kept or keeper.ended, REINIT_SECONDS)
    until = max(map(told_at, late)) + LET_GO_SECONDS + LIMITS["close_seconds"]
    while time.monotonic() < until and not trial.fate():
        trial.sees(other, trial.move())
        trial.rest(SOON / 2)
        if all(reader.ended for reader in late):
            break
    for reader in late:
        seconds = (reader.gone_since or time.monotonic()) - told_at(reader)
        what = "keeps former memory" if reader is keeper else "says nothing of former memory"
        told = f"a reader that {what}, for {seconds:.1f} s"
        trial.judge(trial.fate() or ("closes" if reader.ended else "waits"), told)
        trial.expect(
            seconds >= LET_GO_SECONDS - 2 * SOON, "closed-too-early", f"{told}, was closed then"
        )
    trial.expect(not other.ended, "another-closed", "with it a reader was closed that had let go")
    trial.expect(
        trial.sees(other, trial.move()), "no-frame", "afterwards another reader sees no move"
    )
    changed(trial, client, other_sizes(trial)[1])
    trial.delivered += 1
