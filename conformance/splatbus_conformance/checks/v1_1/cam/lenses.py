"""Checks on `intrinsics` (spec 1.1 section 6.2)."""

from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.images.hard_views import turned_about
from splatbus_conformance.images.known_scene import render
from splatbus_conformance.images.pinhole import Camera
from splatbus_conformance.images.reprojection import APART, AS_SPECIFIED, FITS, ViewPair, agreement
from splatbus_conformance.trials.moves.camera_control import camera_in
from splatbus_conformance.trials.moves.image_session import (
    LENS,
    ImageSession,
    answers,
    at_rest,
    elsewhere,
    further,
)
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import is_number, show, whole
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.sockets import Connection

LENSES = ("1.1", "frames", "pixels", "capability:intrinsics")
LARGEST: int = LIMITS["max_image_size"]
SINGLE = 2.0**-22
"""Two units in the last place of single precision, relative, which a server may count in."""
WHOLE = 0.99
"""The share of the pixels that have to be right."""
LEAST, MOST = LIMITS["min_lens"], LIMITS["max_lens"]
ASKED = (0, 1, -1, 2**31)
BAD_TAGS: tuple[Any, ...] = ("", "t" * (LIMITS["max_tag_chars"] + 1), None, 5, True, [], ["t"], {})
FAR_SHAPES = ((1, 1), (2, 1), (1, 2), (LARGEST, 1), (1, LARGEST), (LARGEST, 2 * LARGEST // 3))


def scaled(lens: Json, size: tuple[int, int]) -> dict[str, Any]:
    """What a server whose images have this size makes of intrinsics (CAM-5)."""
    across, down = size[0] / lens["width"], size[1] / lens["height"]
    factors = {"fx": across, "cx": across, "fy": down, "cy": down, "near": 1.0, "far": 1.0}
    return {name: lens[name] * factors[name] for name in LENS}


def same_shape(width: int, height: int, size: tuple[int, int]) -> bool:
    """Whether intrinsics of this size fit images of the other (CAM-6)."""
    return abs(height * size[0] - width * size[1]) < max(width, height, *size)


def fitting(width: int, size: tuple[int, int]) -> list[int]:
    """The least and the greatest height that fits this width, and one between."""
    middle = max(1, min(LARGEST, round(width * size[1] / size[0])))
    found = [middle]
    for step in (-1, 1):
        height = middle
        while 1 <= height + step <= LARGEST and same_shape(width, height + step, size):
            height += step
        found.append(height)
    return found if same_shape(width, middle, size) else []


def lens_of(photograph: CapturedFrame, width: int, height: int, *changes: float) -> Json:
    """Intrinsics for an image of so many pixels: those of an image, but for factors for fx and fy,
    and parts of the size by which the principal point is moved.
    """
    camera = photograph.camera
    longer, taller, right, down = changes
    across, up = width / camera.width, height / camera.height
    return {
        "fx": camera.fx * across * longer,
        "fy": camera.fy * up * taller,
        "cx": camera.cx * across + right * width,
        "cy": camera.cy * up + down * height,
        "width": width,
        "height": height,
        "near": camera.near,
        "far": camera.far,
    }


def in_force(frame: Json, lens: dict[str, float]) -> str:
    """Which number of a frame's camera is not as these intrinsics say; nothing if all are."""
    camera: Any = frame.get("camera")
    for name, wanted in lens.items():
        told: Any = camera.get(name) if isinstance(camera, dict) else None
        if not (is_number(told) and abs(told - wanted) <= SINGLE * abs(wanted)):
            return f"{name} is {show(told)}, and {wanted!r} was to be expected"
    return ""


def drawn_lenses(first: CapturedFrame) -> st.SearchStrategy[Json]:
    """Intrinsics of all sizes that have the shape of an image."""
    camera = first.camera
    size = camera.width, camera.height
    pairs = st.integers(1, LARGEST).flatmap(
        lambda width: st.sampled_from(fitting(width, size) or [0]).map(
            lambda height: (width, height)
        )
    )
    factor, part = st.floats(0.6, 1.8), st.floats(-0.2, 0.2)
    return st.builds(
        lambda pair, *changes: lens_of(first, *pair, *changes),
        pairs.filter(lambda pair: pair[1] > 0),
        *(factor, factor, part, part),
    )


@check("CAM-5", observable="the camera of frames, and the pixels of images", on={SERVER: LENSES})
def check_images_are_seen_through_the_lens(trial: ServerTrial) -> None:
    """Intrinsics for images of every size that has the shape of the server's, also rounded as far
    as it may be, with other focal lengths, principal points and clipping planes.
    """
    first = first_view(trial)
    size = first.camera.width, first.camera.height
    listed = [
        lens_of(first, size[0], size[1], 1.3, 0.8, 0.1, -0.05),
        *(lens_of(first, w, h, 0.9, 1.1, 0.0, 0.02) for w in (854, 1920) for h in fitting(w, size)),
        lens_of(first, 2 * size[0], 2 * size[1], 1.0, 1.0, 0.0, 0.0) | _cutting(first),
    ]
    session = ImageSession(trial)
    before = session.look()
    for lens in trial.each(listed, drawn_lenses(first), quick=8, full=500):
        told = f"the intrinsics {show(lens)} for images of {size[0]}×{size[1]}"
        before_it = len(session.heard)
        session.capture.go(elsewhere(trial), intrinsics=lens)
        session.answers()
        errors = [it for it in session.heard[before_it:] if it.get("type") == "error"]
        trial.expect(not errors, "refused", f"{told} were answered by {show(errors)}")
        seen, wanted = session.look(intrinsics=lens), scaled(lens, size)
        wrong = in_force(seen.frame, wanted)
        trial.expect(not wrong, "other-intrinsics", f"{told}: of the frame's camera {wrong}")
        _expect_seen_so(trial, before, seen, seen.camera._replace(**wanted), told)
        trial.delivered += 1


def _cutting(first: CapturedFrame) -> Json:
    """Clipping planes between which some of what is seen lies, and some does not."""
    depths = sorted(first.planar()[first.covered()].tolist())
    return {"near": depths[len(depths) // 4], "far": depths[3 * len(depths) // 4]}


def _expect_seen_so(
    trial: ServerTrial, before: CapturedFrame, seen: CapturedFrame, camera: Camera, told: str
) -> None:
    """The pixels are those of this camera: by the scene, where that is known, or by an image from
    before that shows the same surfaces.
    """
    if trial.facts.scene_known:
        exact = render(camera, trial.facts.setting(seen.frame))
        share = exact.agreement(seen.color, seen.planar())
        trial.expect(
            share >= WHOLE,
            "other-pixels",
            f"{told}: {1 - share:.0%} of the pixels are not as seen so",
        )
        return
    unchanged = before.camera._replace(pose=camera.pose)
    by_lens, by_former = (
        agreement(ViewPair(before.view(), seen.view()._replace(camera=each)), AS_SPECIFIED)
        for each in (camera, unchanged)
    )
    trial.expect(
        by_lens >= FITS or by_former < FITS or by_former - by_lens < APART,
        "former-intrinsics",
        f"{told}: the image fits the intrinsics before them, at {by_former:.0%} of the points",
    )


def other_shapes(size: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Sizes that just do not have the shape of images, then others."""
    for width in (size[0], 640, 1920, 4096):
        for height in sorted(fitting(width, size))[::2]:
            for beyond in (height - 1, height + 1):
                if 1 <= beyond <= LARGEST and not same_shape(width, beyond, size):
                    yield width, beyond
    if not same_shape(size[1], size[0], size):
        yield size[1], size[0]
    yield from (it for it in FAR_SHAPES if not same_shape(*it, size))


@check(
    "CAM-6", observable="the error, and the cameras of the frames that follow", on={SERVER: LENSES}
)
def check_refuses_lenses_of_another_shape(trial: ServerTrial) -> None:
    """Intrinsics whose shape is off by just as much as it may not be, and by more, in poses that
    move the camera: no part of them is applied.
    """
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    good = lens_of(first, *size, 1.25, 1.25, 0.0, 0.0)
    session.look(intrinsics=good)
    for width, height in trial.each(list(dict.fromkeys(other_shapes(size)))):
        told = f"intrinsics for {width}×{height}, of images of {size[0]}×{size[1]}"
        before, known = len(session.heard), len(session.frames)
        bad = lens_of(first, width, height, 0.7, 0.7, 0.1, 0.1)
        session.capture.go(turned_elsewhere(trial), intrinsics=bad, tag="refused")
        trial.expect(session.answers(), "no-reply", f"{told}: the next request was not answered")
        errors = [it for it in session.heard[before:] if it.get("type") == "error"]
        codes = [(it.get("code"), it.get("pointer")) for it in errors]
        trial.expect(
            codes == [("invalid_message", "/intrinsics")],
            "another-error" if codes else "no-error",
            f"{told}, were answered by {show(codes) if codes else 'no error'}",
        )
        former, *frames = session.nudged(known - 1)
        applied = what_was_applied(former, frames)
        trial.expect(
            not applied, "applies", f"{told}, were refused, and the pose was applied: {applied}"
        )
        wrong = in_force(frames[-1], scaled(good, size))
        trial.expect(
            not wrong,
            "other-intrinsics",
            f"{told}, were refused, and then of the frame's camera {wrong}",
        )
        trial.delivered += 1


@check(
    "CAM-7", observable="the cameras of frames after poses without intrinsics", on={SERVER: LENSES}
)
def check_keeps_the_lens_in_force(trial: ServerTrial) -> None:
    """Poses with intrinsics, and then whatever leaves them in force: poses without them, of the
    Gaussians too, those of a client without control, and those that are refused.
    """
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    own = {name: first.frame["camera"][name] for name in LENS}
    wrong = in_force(session.look().frame, own)
    trial.expect(
        not wrong, "other-intrinsics", f"nobody sent intrinsics, and of the frame's camera {wrong}"
    )
    other = further(trial, session.poser)
    lens = lens_of(first, *size, 0.75, 0.75, 0.0, 0.0)
    foreign = lens_of(first, *size, 2.0, 2.0, 0.0, 0.0)
    odd, no_pose = foreign | {"height": 2 * size[1] + 2}, camera_pose(rotation=(0.0, 0.0, 0.0, 2.0))
    for number in trial.each(range(3)):
        lens = lens | {"fx": lens["fx"] * 1.125, "cx": lens["cx"] + number}
        wanted = scaled(lens, size)
        session.look(intrinsics=lens)
        known = len(session.frames)
        for moment, sender, message in (
            ("the next pose had none", None, None),
            ("the Gaussians were moved", None, at_rest()),
            ("another client had sent its own", other, camera_pose() | {"intrinsics": foreign}),
            ("the next pose had none, beside those of another client", None, None),
            ("others of another shape were refused", None, camera_pose() | {"intrinsics": odd}),
            ("others were refused with their pose", None, no_pose | {"intrinsics": foreign}),
            ("some that are none were refused", None, camera_pose() | {"intrinsics": {}}),
        ):
            if message is None:
                session.look()
            elif not _goes_on(trial, sender or session.poser, message):
                trial.expect(
                    session.end() == "closes",
                    "no-reply",
                    f"{moment}, and then: {session.end()}",
                )
                trial.peer.close_all()
                session = ImageSession(trial)
                other = further(trial, session.poser)
                break
            for frame in session.nudged(known):
                wrong = in_force(frame, wanted)
                trial.expect(
                    not wrong,
                    "other-intrinsics",
                    f"intrinsics were sent, {moment}, and now {wrong}",
                )
        trial.delivered += 1


def _goes_on(trial: ServerTrial, sender: Connection, message: Json) -> bool:
    """Whether a server answers after this, which it may also close for (POS-6, CAM-9)."""
    trial.viewer.say(sender, message)
    return answers(trial, sender)


@check(
    "CAM-8",
    observable="the intrinsics in replies to get_camera_pose",
    on={SERVER: ("1.1", "capability:intrinsics")},
)
def check_tells_the_lens_of_its_cameras(trial: ServerTrial) -> None:
    """Several cameras are asked for, on a connection that agreed on intrinsics, before and after it
    has sent its own.
    """
    connection = trial.commanding()
    across, down = trial.facts.size
    if not (across and down):
        trial.not_observable("the size of the images is not known")
    former: dict[int, Any] = {}
    for index in trial.each(ASKED * 2):
        reply = trial.ask(connection, {"type": "get_camera_pose", "cam_idx": index, "id": 7}) or {}
        told: Any = reply.get("intrinsics")
        of = f"the intrinsics of camera {index}"
        trial.expect(isinstance(told, dict), "no-intrinsics", f"{of} are {show(told)}")
        size = whole(told.get("width"), 1), whole(told.get("height"), 1)
        trial.expect(
            size == (across, down),
            "wrong-size",
            f"{of} are for {size[0]}×{size[1]}, and images have {across}×{down}",
        )
        trial.expect(
            former.setdefault(index, told) == told,
            "intrinsics-changed",
            f"{of} were {show(former[index])}, and after those of a client {show(told)}",
        )
        if len(former) == len(ASKED):
            longer = told | {"fx": 2.0 * told["fx"], "fy": 2.0 * told["fy"]}
            trial.move(camera_pose() | {"intrinsics": longer})
        trial.delivered += 1


@check(
    "CAM-9",
    observable="the cameras of the frames that follow",
    on={SERVER: ("1.1", "frames", "pixels")},
)
def check_keeps_the_former_camera(trial: ServerTrial) -> None:
    """Poses whose tag or intrinsics are none, of which no part may be applied."""
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    good = lens_of(first, *size, 1.25, 1.25, 0.0, 0.0)
    has_lens = trial.facts.grants("intrinsics")
    broken = [("tag", value) for value in BAD_TAGS]
    if has_lens:
        broken += [("intrinsics", value) for value in bad_lenses(good)]
        session.look(intrinsics=good)
    for name, value in trial.each(broken):
        known = len(session.frames)
        session.capture.go(turned_elsewhere(trial), **{name: value})
        what = f"a pose with the {name} {show(value)}"
        if not session.answers():
            trial.judge(session.end(), what)
            trial.peer.close_all()
            session = ImageSession(trial)
            session.look(**({"intrinsics": good} if has_lens else {}))
            continue
        former, *frames = session.nudged(known - 1)
        applied = what_was_applied(former, frames)
        if has_lens:
            applied = applied or in_force(frames[-1], scaled(good, size))
        trial.judge("applies" if applied else "keeps", f"{what}; {applied}" if applied else what)
        trial.delivered += 1


def turned_elsewhere(trial: ServerTrial) -> Pose:
    """A camera that is moved and turned, so that a part of it alone is seen."""
    position, rotation = elsewhere(trial)
    return Pose(position, turned_about(rotation, (1, -2, 3), 0.25))


def what_was_applied(former: Json, frames: list[Json]) -> str:
    """What was applied of a pose that was refused, by the frames since; nothing if nothing was."""
    camera = camera_in(former)
    for frame in frames:
        now = camera_in(frame)
        if camera is None or now is None or not now.shows(camera):
            return f"the camera is at {now}"
        if "tag" in frame["camera"]:
            return "its tag came"
    return ""


def bad_lenses(good: Json) -> Iterator[Any]:
    """Every way to break CAM-4."""
    yield from (None, [], {}, "wide", 1.0)
    for name in good:
        yield {member: value for member, value in good.items() if member != name}
        yield good | {name: str(good[name])}
    for name in ("fx", "fy", "near", "far"):
        yield from (good | {name: value} for value in (0.0, -1.0, LEAST / 2, 2 * MOST))
    for name in ("cx", "cy"):
        yield from (good | {name: value} for value in (2 * MOST, -2 * MOST))
    for name in ("width", "height"):
        yield from (good | {name: value} for value in (0, -1, good[name] + 0.5, 10**6))
    yield good | {"near": good["far"], "far": good["near"]}
    yield good | {"near": good["far"]}
