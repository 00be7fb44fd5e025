"""Checks on how servers lend images (spec 1.1 chapter 5)."""

import numpy as np
from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.memory.cuda_stand_in import publishing
from splatbus_conformance.images.memory.cuda_stand_in.session import SLOW_RECORDS
from splatbus_conformance.trials.controls import shows
from splatbus_conformance.trials.moves.announced import announced, calls_of
from splatbus_conformance.trials.moves.frame_capture import FrameCapture
from splatbus_conformance.trials.moves.frame_readers import (
    LENDS,
    beside,
    expect_shown,
    fell_silent,
    holding,
    joined,
    memory_of,
    pause_for_an_image,
    pinning,
)
from splatbus_conformance.trials.moves.image_session import refused_poses
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import REACTION_SECONDS
from splatbus_conformance.wire.json_values import show, whole
from splatbus_conformance.wire.messages import Json, camera_pose, says_of
from splatbus_conformance.wire.sockets import Connection

FRAME_SECONDS: float = LIMITS["frame_seconds"]
QUIET_SECONDS = 0.4
"""A server that sends no frame for so long, to a reader that waits, has none to send."""
PACES = 4
"""So many times as long as it took for an image that was due, where that is longer."""
RENDER_SECONDS = 0.05
"""Time for an image that nobody is shown yet: more cases find it ready than not."""
RESENT = 25
"""How often the same pose is sent: half a second of a viewer."""
SAME_IMAGES = 5
"""As many images that show the same show a scene that does not move."""


@check("IMG-2", on={SERVER: LENDS})
def check_lends_one_at_a_time(trial: ServerTrial) -> None:
    """Memory is announced and not answered, then frames are held, while the camera moves on."""
    pause = pause_for_an_image(trial, REACTION_SECONDS)
    trial.viewer.opens = trial.viewer.releases = False
    connection = trial.greeted("ipc")
    dealings = trial.with_(connection)
    if not trial.grows(connection, dealings.init_packets):
        trial.not_observable("the server announced no memory")
    trial.move()
    trial.rest(pause)
    trial.expect(not dealings.frames, "before-opened", "a frame came before opened")
    trial.viewer.open(connection, dealings.init_packets[0])
    for count in (1, 2, 3):
        came = trial.grows(connection, dealings.frames, count - 1)
        trial.expect(
            came, "no-frame", f"frame {count} did not come after {count - 1} were released"
        )
        for _ in range(3):
            trial.move()
            trial.rest(REACTION_SECONDS / 3)
        trial.rest(pause)
        more = len(dealings.frames) - count
        trial.expect(not more, "another-frame", f"{more} frames came while one was held")
        trial.viewer.release(connection, dealings.frames[-1])


@check(
    "IMG-2",
    on={SERVER: LENDS},
    cases=Cases(("closed", "open_failed")),
)
def check_lends_nothing_after_closed(trial: ServerTrial, answer: str) -> None:
    """A reader that holds a frame says that it has closed the memory, or that it could not open it
    after all; another one sees the camera move.
    """
    holder, held = holding(trial)
    other = beside(trial, holder)
    frames = trial.with_(holder).frames
    before = len(frames)
    trial.viewer.say(holder, says_of(held["generation"], answer))
    for _ in range(3):
        expect_shown(trial, other, trial.move())
    came, what = len(frames) - before, f"after {answer}, and no opened"
    trial.expect(not came, "after-closed", f"{came} frames came {what}")
    holder.close()
    other.close()


@check("IMG-23", on={SERVER: LENDS})
def check_sends_no_frames_that_were_not_agreed(trial: ServerTrial) -> None:
    """A reader that does not declare `frames` opens the memory, and the camera moves."""
    pause = pause_for_an_image(trial, REACTION_SECONDS)
    connection = trial.ready("ipc", capabilities=["host_shm"])
    for _ in range(3):
        trial.move()
        trial.rest(REACTION_SECONDS / 3)
    trial.rest(pause)
    frames = trial.with_(connection).frames
    trial.expect(
        not frames, "not-granted", f"{len(frames)} frames came, although welcome lists no frames"
    )
    connection.close()
    seen = trial.sees(trial.reading(), trial.move())
    trial.expect(seen, "no-frame", "a reader that declares frames is sent none")


@check("IMG-3", on={SERVER: LENDS})
def check_announces_the_newest(trial: ServerTrial) -> None:
    """One reader holds a frame while another is shown newer images; then it releases."""
    holder, held = holding(trial)
    watcher = beside(trial, holder)
    frames = trial.with_(holder).frames
    for moves in trial.each(drawn=st.lists(st.booleans(), min_size=1), quick=8, full=200):
        for waits in moves:
            pose = trial.move()
            if waits:
                expect_shown(trial, watcher, pose)
        expect_shown(trial, watcher, pose)
        before = len(frames)
        trial.viewer.release(holder, held)
        came = trial.grows(holder, frames, before)
        trial.expect(
            came, "no-frame", "no frame came after release, although there was a newer image"
        )
        held = frames[before]
        trial.expect(
            shows(held, pose),
            "not-the-newest",
            f"after release came the image of a camera at {held['camera']['position']}, although "
            f"that of {list(pose['position'].values())} was whole: another reader had it",
        )


@check("IMG-7", on={SERVER: ("stand-in", "capability:cuda_ipc", *LENDS)})
def check_records_the_event_before_the_frame(trial: ServerTrial) -> bool:
    """The server is launched anew with a runtime whose records take 5 milliseconds, so that one
    which is made after the frame was sent comes after the frame has arrived.
    """
    with trial.relaunched(**SLOW_RECORDS):
        connection = trial.reading()
        shown = announced(trial, connection)
        frames = trial.with_(connection).frames
        for _ in trial.each(range(100 if trial.thorough else 20)):
            before = len(frames)
            trial.move()
            trial.grows(connection, frames, before)
        trial.rest(0.05)
        if not frames:
            trial.not_observable("the server sent no frame")
        written = False
        came = (it for it in connection.messages if it.type == "frame")
        for frame, at in zip(frames, map(connection.arrived, came), strict=True):
            slot = whole(frame.get("slot"), 0) or 0
            planes = publishing.slot_planes(shown.packet, slot)
            event = shown.names.get(f"ring.events[{slot}]", "")
            calls = (call for call in calls_of(trial, shown.process) if call.time <= at)
            if found := publishing.moments(calls, event, planes):
                told = f"when frame {frame.get('seq')} came, the event of slot {slot} was not"
                told += f" recorded behind the last write to it, {found[-1].call}"
                trial.expect(not found[-1].open, "event-not-recorded", told)
                written = True
    return written


@check("IMG-10", on={SERVER: LENDS})
def check_publishes_what_changed_only(trial: ServerTrial) -> None:
    """Nothing moves; then the pose that holds is sent again and again, spelled otherwise too."""
    connection = trial.reading()
    frames = trial.with_(connection).frames
    pose, began = trial.move(), trial.peer.clock()
    trial.expect(trial.sees(connection, pose), "no-frame", "a pose gave no new image")
    pace = trial.peer.clock() - began
    if not quiet(trial, frames):
        expect_different_images(trial)
        trial.not_observable("the scene moves by itself")
    before = len(frames)
    for number in range(RESENT):
        trial.move(pose | {"timestamp": number / 50})
        trial.rest(0.005)
    trial.move(pose | {name: round_numbers(pose[name]) for name in ("position", "rotation")})
    trial.rest(max(QUIET_SECONDS, PACES * pace))
    another = trial.sees(connection, trial.move())
    came = (frames.index(another) if another else len(frames)) - before
    trial.expect(
        not came,
        "published-unchanged",
        f"{came} images were published after a pose that changed nothing",
    )
    trial.expect(another, "no-frame", "another pose gave no new image")


@check(
    "IMG-10",
    on={SERVER: LENDS},
)
def check_publishes_nothing_for_what_changes_nothing(trial: ServerTrial) -> None:
    """Nothing moves; then come poses that are refused, and the time and the objects as they are."""
    client, connection = trial.commanding(), trial.reading()
    frames = trial.with_(connection).frames
    pose = camera_pose((0.0625, 0.125, -1.0), (0.0, 0.6, 0.0, 0.8))
    at_rest = camera_pose(kind="point_cloud_pose")
    same: list[Json] = [at_rest]
    if trial.facts.grants("time"):
        same.append({"type": "set_time", "time": 0.5})
    if trial.facts.grants("objects"):
        same.append(at_rest | {"type": "object_pose", "object": "default", "scale": 1.0})
    for message in (*same, pose):
        trial.viewer.say(client, message)
    trial.expect(trial.sees(connection, pose), "no-frame", "a pose gave no new image")
    if not quiet(trial, frames):
        trial.not_observable("the scene moves by itself")
    for message in trial.each([*refused_poses(trial), *same, pose]):
        before = len(frames)
        for _ in range(SAME_IMAGES):
            trial.viewer.say(client, message)
        if not trial.answers(client):
            trial.not_observable("the server ends the connection of who sends a broken pose")
        trial.rest(QUIET_SECONDS)
        came = len(frames) - before
        trial.expect(
            not came,
            "published-unchanged",
            f"{came} images came of {show(message)}, which changes nothing",
        )
    trial.viewer.say(client, moved := camera_pose((1.0, 0.125, -1.0)))
    trial.expect(trial.sees(connection, moved), "no-frame", "another pose gave no new image")


def round_numbers(value: Json) -> Json:
    """Integers where a number is one."""
    return {name: int(each) if each == int(each) else each for name, each in value.items()}


def quiet(trial: ServerTrial, frames: list[Json]) -> bool:
    """Whether no frame comes for a while, after those that are on their way."""
    trial.rest(REACTION_SECONDS)
    before = len(frames)
    trial.rest(QUIET_SECONDS)
    return len(frames) == before


def expect_different_images(trial: ServerTrial) -> None:
    """Of a server that goes on sending frames while nothing is sent to it: that they differ."""
    capture, images = FrameCapture(trial), list[CapturedFrame]()

    def enough() -> bool:
        images.extend(capture.new())
        return len(images) >= SAME_IMAGES or capture.reader.ended is not None

    trial.wait(enough)
    if len(images) < SAME_IMAGES:
        trial.not_observable("the server sent no further frame")
    trial.expect(
        any(not same(images[0], image) for image in images[1:]),
        "published-unprompted",
        f"nothing moved, and {SAME_IMAGES} images were published that show the same",
    )


def same(one: CapturedFrame, other: CapturedFrame) -> bool:
    """Whether two images are of the same camera, time and objects, and equal in every pixel."""
    pixels = (one.color, other.color), (one.depth, other.depth)
    named = all(one.frame.get(it) == other.frame.get(it) for it in ("camera", "time", "objects"))
    return named and all(np.array_equal(*pair, equal_nan=True) for pair in pixels)


@check("IMG-11", on={SERVER: LENDS})
def check_sends_what_is_new(trial: ServerTrial) -> None:
    """The camera moves before a reader connects, while it waits and while it holds a frame."""
    moments = st.lists(st.sampled_from(("waiting", "holding", "connecting")), min_size=1)
    connection = trial.reading()
    for script in trial.each(drawn=moments, quick=8, full=300):
        for moment in script:
            dealings = trial.with_(connection)
            if moment == "holding":
                held = pinning(trial, connection)
                trial.expect(
                    held, "no-frame", "no frame came when the camera moved, to a reader that waits"
                )
            pose = trial.move()
            if moment == "holding":
                trial.rest(RENDER_SECONDS)
                dealings.holds = False
                trial.viewer.release(connection, dealings.frames[-1])
            elif moment == "connecting":
                connection.close()
                connection = trial.reading()
            seen = trial.sees(connection, pose, FRAME_SECONDS)
            trial.expect(
                seen, "no-frame", f"no frame came when the camera had moved while {moment}"
            )


HOLDING, WAITING, AGAIN = "holding", "waiting", "waiting, having given it up"
"""How a reader of a scene at rest comes to want depth."""
SUBSCRIBED = (*LENDS, "capability:subscribe")


@check(
    "IMG-25",
    on={SERVER: SUBSCRIBED},
    given=ServerTrial.reading,
    cases=Cases((WAITING, HOLDING, AGAIN)),
)
def check_shows_what_is_newly_subscribed_to(
    trial: ServerTrial, connection: Connection, how: str
) -> None:
    """A reader of colour subscribes to depth too, while it waits or holds a frame, and nothing else
    happens; or it gives depth up and wants it again, after an image that it might have read whole.
    It is sent frames until one can be read as subscribed.
    """
    expect_depth(trial, connection, how)


@check(
    "IMG-25",
    on={SERVER: SUBSCRIBED},
    given=ServerTrial.reading,
    cases=Cases((WAITING, HOLDING)),
)
def check_shows_it_beside_who_reads_both(
    trial: ServerTrial, connection: Connection, how: str
) -> None:
    """The same beside a reader of both, for whom the newest image has depth already."""
    if (other := joined(trial)) is None:
        trial.not_observable("the server serves one reader at a time")
    expect_depth(trial, connection, how)
    other.close()


def expect_depth(trial: ServerTrial, connection: Connection, how: str) -> None:
    """The frames that are owed to a reader that comes to want depth."""
    frames = trial.with_(connection).frames
    some = {"type": "subscribe", "channels": ["color"]}
    if how != AGAIN:
        trial.viewer.say(connection, some)
    for _ in range(2):  # the first may have been on its way
        expect_shown(trial, connection, trial.move())
    held = pinning(trial, connection) if how == HOLDING else None
    if how == HOLDING and held is None:
        fell_silent(trial, connection, "no frame came when the camera moved")
    quiet(trial, frames)
    before, owed = len(frames), 1 if held else 2
    if how == AGAIN:
        trial.viewer.say(connection, some)
    trial.viewer.say(connection, {"type": "subscribe", "channels": ["color", "depth"]})
    if held is not None:
        trial.with_(connection).holds = False
        trial.viewer.release(connection, held)
    came = trial.grows(connection, frames, before + owed - 1, owed * FRAME_SECONDS)
    trial.expect(
        came,
        "no-frame",
        f"{len(frames) - before} of {owed} frames came when a reader had subscribed to depth too, "
        f"{how}",
    )


@check(
    "IMG-21",
    on={SERVER: SUBSCRIBED},
    given=ServerTrial.reading,
    cases=Cases(("color", "depth")),
)
def check_writes_only_what_is_wanted(
    trial: ServerTrial, connection: Connection, wanted: str
) -> None:
    """The only reader subscribes to colour, then to depth, and compares what it does not want."""
    trial.viewer.say(connection, {"type": "subscribe", "channels": [wanted]})
    for _ in range(3):  # one image may have been on its way when the subscription came
        expect_shown(trial, connection, trial.move())
    memory = memory_of(trial, connection)
    other = "depth" if wanted == "color" else "color"
    read = memory.depth if wanted == "color" else memory.color

    def unwanted() -> list[bytes]:
        return [read(slot).tobytes() for slot in range(memory.layout.slots)]

    before = unwanted()
    for _ in range(2 * memory.layout.slots):
        trial.sees(connection, trial.move())
    trial.expect(
        before == unwanted(),
        "written-unwanted",
        f"{other} was written, which no open connection wants",
    )
