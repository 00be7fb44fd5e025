"""Checks on what a server makes of images that got another size (spec 1.1 chapters 6 and 8)."""

from splatbus_conformance.checks import check
from splatbus_conformance.checks.server.lenses import same_shape
from splatbus_conformance.messages import Json, camera_pose, encode
from splatbus_conformance.messages import intrinsics as lens_for
from splatbus_conformance.packets import packet
from splatbus_conformance.resizing import (
    REINIT_SECONDS,
    RESIZES,
    changed,
    dealings_of,
    other_sizes,
    resizing,
)
from splatbus_conformance.server_trial import VIEWPORT_REQUEST, ServerTrial
from splatbus_conformance.studio import further
from splatbus_conformance.values import show, within

TAG = "from before another size"
BEHIND = 40
"""Requests in one write."""


@check("CAM-3", observable="the tags of frames of another size", needs=RESIZES)
def check_no_tag_comes_again_with_another_size(trial: ServerTrial) -> None:
    """A reader is sent the tag of a pose; then images have another size, and show the same pose."""
    with resizing(trial) as client:
        reader = trial.reading()
        pose = trial.move(camera_pose((0.25, 0.5, -2.0)) | {"tag": TAG})
        if trial.sees(reader, pose) is None:
            trial.not_observable("no frame shows a pose that was sent before")
        frames = dealings_of(trial, reader).frames
        for size in trial.each(other_sizes(trial)[:2]):
            before = len(frames)
            changed(trial, client, size)
            came = trial.wait(lambda: len(frames) > before, 2 * REINIT_SECONDS)  # noqa: B023
            if not came:
                trial.not_observable("no frame of another size came")
            tags = [within(frame, "camera", "tag") for frame in frames]
            trial.expect(
                tags.count(TAG) <= 1, f"a pose whose tag came has it again at {size[0]}×{size[1]}"
            )
            trial.delivered += 1


@check(
    "CAM-6",
    observable="the answer to intrinsics, once images have another shape",
    needs=(*RESIZES, "capability:intrinsics"),
)
def check_lenses_have_the_shape_of_the_newest_images(trial: ServerTrial) -> None:
    """Images get a size of another shape: intrinsics of that are taken, and those of the former
    shape are not.
    """
    with resizing(trial) as client:
        former = trial.facts.size
        others = [it for it in other_sizes(trial) if not same_shape(*former, it)]
        if not others:
            trial.not_observable("images of these sizes have the same shape")
        changed(trial, client, others[0])
        heard = dealings_of(trial, client).heard
        for size in trial.each([others[0], former]):
            before = len(heard)
            trial.viewer.say(client, camera_pose() | {"intrinsics": lens_for(*size)})
            trial.answers(client)
            pointers = [it.get("pointer") for it in heard[before:] if it.get("type") == "error"]
            wanted = [] if size == others[0] else ["/intrinsics"]
            what = f"images have {others[0][0]}×{others[0][1]}, and intrinsics for"
            told = f"{what} {size[0]}×{size[1]} had errors with the pointers {show(pointers)}"
            trial.expect(pointers == wanted, told)
            trial.delivered += 1


@check("REQ-4", observable="the size that all are told", needs=RESIZES)
def check_tells_everybody_of_the_newest_size(trial: ServerTrial) -> None:
    """Clients of 1.0 and 1.1 ask for the size before images get another, and again afterwards."""
    with resizing(trial) as client:
        others = [further(trial, client), trial.dial("msg")]
        trial.require_all(client, *others)
        for size in trial.each(other_sizes(trial)[:2]):
            changed(trial, client, size)
            for other in others:
                told: Json = trial.ask(other, VIEWPORT_REQUEST) or {}
                now = told.get("viewport_size")
                what = f"images have {size[0]}×{size[1]} now, and who asked before is told"
                trial.expect(now in (list(size), [0, 0]), f"{what} {show(now)}")
            trial.delivered += 1


@check("CHN-16", observable="every answer, and then the end of the stream", needs=RESIZES)
def check_answers_behind_another_size_before_the_end(trial: ServerTrial) -> None:
    """A `set_viewport`, whose reply takes a server time, many requests behind it in the same write,
    and then the client's end of stream.
    """
    with resizing(trial):
        for size in trial.each(other_sizes(trial)[:2]):
            trial.peer.close_all()
            client = trial.greeted("msg")
            heard = dealings_of(trial, client).heard
            before = len(heard)
            request = {"type": "set_viewport", "width": size[0], "height": size[1], "id": 0}
            asked = [request, *(VIEWPORT_REQUEST | {"id": n} for n in range(1, BEHIND))]
            client.send(b"".join(packet(encode(each)) for each in asked))
            client.end_stream()
            closed = trial.ends(client, 2 * REINIT_SECONDS)
            told = [it["id"] for it in heard[before:] if "id" in it]
            what = f"{BEHIND} requests, of which the first is for another size, and the end"
            trial.expect(told == list(range(BEHIND)), f"{len(told)} answers to {what}")
            trial.expect(closed, f"the server kept the connection open after {what}")
            trial.delivered += 1
