"""Checks on what holds after images have changed their size, as it did before (spec 1.1).

What was computed once, for the first size, and kept, is right until then.
"""

from collections.abc import Callable

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST, shows
from splatbus_conformance.trials.moves.camera_control import camera_in, camera_of
from splatbus_conformance.trials.moves.frame_readers import fell_silent
from splatbus_conformance.trials.moves.image_session import (
    answers,
    elsewhere,
    errors_after,
    expect_error,
    further,
)
from splatbus_conformance.trials.moves.lenses import (
    expect_in_force,
    lens_of,
    same_shape,
    scaled,
)
from splatbus_conformance.trials.moves.resizing import (
    REINIT_SECONDS,
    RESIZES,
    Sitting,
    Size,
    asked,
    changed,
    other_sizes,
    resizing,
    sitting,
)
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show, whole, within
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.sockets import Connection

LENSES = ("1.1", "capability:viewport", "capability:intrinsics")
TAG = "of the former size"
BEHIND = 40
"""Requests in one write."""


def other(most: int) -> Callable[..., Cases]:
    """So many sizes that images do not have; few, since each has its own memory."""
    return lambda trial, *_: Cases(other_sizes(trial)[:most])


def of_another_shape(trial: ServerTrial, *_: object) -> Cases:
    """Sizes of another shape than images have."""
    found = [size for size in other_sizes(trial) if not same_shape(*trial.facts.size, size)]
    if not found:
        trial.not_observable("no other size has another shape than its images")
    return Cases(found[:2])


@check("CAM-6", on={SERVER: LENSES}, given=resizing, cases=of_another_shape)
def check_compares_shapes_with_the_size_now(
    trial: ServerTrial, client: Connection, size: Size
) -> None:
    """Images become of another shape; then intrinsics of the shape that they had are refused, and
    those of their own are not.
    """
    changed(trial, client, size)
    for shape in (trial.facts.size, size):
        lens = lens_of(first_view(trial, 0.0), *shape)
        pose = camera_pose(*elsewhere(trial)) | {"intrinsics": lens}
        errors, answered = errors_after(trial, client, encode(pose))
        trial.expect(answered, "no-reply", "the request behind a pose was not answered")
        what = f"images became {size[0]}×{size[1]}, and a pose for {shape[0]}×{shape[1]}"
        if shape == size:
            trial.expect(not errors, "refused", f"{what} was answered by {show(errors)}")
        else:
            expect_error(trial, errors, "invalid_message", "/intrinsics", what)


@check("CTL-5", on={SERVER: (*RESIZES, "capability:intrinsics")}, cases=of_another_shape)
def check_scales_a_lens_that_waited(trial: ServerTrial, size: Size) -> None:
    """A client that waits for control sends intrinsics, and then another camera without; meanwhile
    images become of another shape. Then control passes to it.
    """
    with sitting(trial) as (client, capture):
        capture.take(elsewhere(trial), None)
        waiting, camera = further(trial, client), camera_pose((0.5 + size[0], 0.5, -3.0))
        lens = lens_of(first_view(trial, 0.0), *trial.facts.size, 1.25, 1.5)
        for pose in (camera_pose(*elsewhere(trial)) | {"intrinsics": lens}, camera):
            trial.viewer.say(waiting, pose)
            answered = answers(trial, waiting)
            trial.expect(answered, "no-reply", "who waits for control was not answered")
        changed(trial, client, size, capture.reader)
        asked(trial, waiting, size)  # or the server may go back to its own when the other has gone
        client.close()
        trial.wait(lambda: capture.new() and shows(trial.with_(capture.reader).frames[-1], camera))
        frame = trial.sees(capture.reader, camera, 0.0)
        what = f"images became {size[0]}×{size[1]}, and control passed on to who had sent a lens"
        trial.expect(frame, "no-frame", f"{what} before: no frame shows its camera")
        width, height = (within(frame or {}, "camera", side) for side in ("width", "height"))
        now = whole(width, 1) or size[0], whole(height, 1) or size[1]
        expect_in_force(trial, frame or {}, scaled(lens, now), f"{what} for the former size")


@check("CAM-8", on={SERVER: LENSES}, given=resizing, cases=other(3))
def check_tells_lenses_for_the_size_now(trial: ServerTrial, client: Connection, size: Size) -> None:
    """A camera is asked for whenever images have become of another size."""
    changed(trial, client, size)
    reply = trial.ask(client, {"type": "get_camera_pose", "cam_idx": 0, "id": 3}) or {}
    told = tuple(within(reply, "intrinsics", name) for name in ("width", "height"))
    trial.expect(
        told == size,
        "wrong-size",
        f"images became {size[0]}×{size[1]}, and a camera is told with intrinsics for"
        f" {show(told[0])}×{show(told[1])}",
    )


@check("CAM-3", on={SERVER: RESIZES}, given=sitting, cases=other(3))
def check_no_tag_comes_again_in_another_size(
    trial: ServerTrial, given: Sitting, size: Size
) -> None:
    """An image of a pose with a tag is shown; then images become of another size, and are of that
    pose still.
    """
    client, capture = given
    tag = f"{TAG}, {size[0]}×{size[1]}"
    capture.take(elsewhere(trial), None, insists=False, tag=tag)  # said twice, it may come twice
    changed(trial, client, size, capture.reader)
    frames = trial.with_(capture.reader).frames
    now = whole(capture.dealings.init_packets[-1].get("generation"))
    trial.wait(lambda: frames[-1].get("generation") == now)
    capture.take(elsewhere(trial), None)
    tags = [within(frame, "camera", "tag") for frame in frames]
    trial.expect(
        tags.count(tag) <= 1,
        "tag-twice",
        f"the tag {tag!r} came {tags.count(tag)} times, since images became of another size",
    )


@check("POS-7", on={SERVER: RESIZES}, given=sitting, cases=other(3))
def check_the_camera_stays_in_another_size(trial: ServerTrial, given: Sitting, size: Size) -> None:
    """The camera is moved; then images become of another size, and nothing else is said."""
    client, capture = given
    wanted = elsewhere(trial)
    capture.take(wanted, None)
    frames = trial.with_(capture.reader).frames
    before, former = len(frames), frames[-1]["generation"]
    changed(trial, client, size)
    trial.wait(lambda: frames[-1]["generation"] != former)
    later = [frame for frame in frames[before:] if frame["generation"] != former]
    if not later:
        fell_silent(trial, capture.reader, "the server sent no image of the new size")
    camera = camera_in(later[0])
    shown = camera and camera.shows(camera_of(camera_pose(*wanted)))
    trial.expect(
        shown,
        "another-camera",
        f"the camera was put at {wanted}; then images became {size[0]}×{size[1]}, and the first of"
        f" them is of one at {camera}",
    )
    capture.new()


@check("REQ-4", on={SERVER: RESIZES}, given=resizing, cases=other(2))
def check_tells_everybody_of_the_newest_size(
    trial: ServerTrial, client: Connection, size: Size
) -> None:
    """Clients of 1.0 and 1.1 ask for the size before images get another, and again afterwards."""
    others = [further(trial, client), trial.dial("msg")]
    trial.require_all(client, *others)
    changed(trial, client, size)
    for each in others:
        told: Json = trial.ask(each, VIEWPORT_REQUEST) or {}
        now = told.get("viewport_size")
        what = f"images have {size[0]}×{size[1]} now, and who asked before is told"
        trial.expect(now in (list(size), [0, 0]), "wrong-size", f"{what} {show(now)}")
        each.close()


@check("CHN-16", on={SERVER: RESIZES}, given=resizing, cases=other(2))
def check_answers_behind_another_size_before_the_end(
    trial: ServerTrial, _: Connection, size: Size
) -> None:
    """A `set_viewport`, whose reply takes a server time, many requests behind it in the same write,
    and then the client's end of stream.
    """
    trial.peer.close_all()
    client = trial.greeted("msg")
    heard = trial.with_(client).heard
    before = len(heard)
    request = {"type": "set_viewport", "width": size[0], "height": size[1], "id": 0}
    asked = [request, *(VIEWPORT_REQUEST | {"id": n} for n in range(1, BEHIND))]
    trial.viewer.say(client, *asked)
    client.end_stream()
    closed = trial.ends(client, 2 * REINIT_SECONDS)
    told = [it["id"] for it in heard[before:] if "id" in it]
    what = f"{BEHIND} requests, of which the first is for another size, and the end"
    trial.expect(told == list(range(BEHIND)), "wrong-count", f"{len(told)} answers to {what}")
    trial.expect(closed, "not-closed", f"the server kept the connection open after {what}")
