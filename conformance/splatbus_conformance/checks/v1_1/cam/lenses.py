"""Checks on `intrinsics` (spec 1.1 section 6.2)."""

from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st
from splatbus_schemas import LIMITS, examples

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
    NARROW,
    ImageSession,
    answers,
    at_rest,
    elsewhere,
    errors_after,
    expect_error,
    further,
)
from splatbus_conformance.trials.moves.lenses import (
    expect_in_force,
    in_force,
    lens_of,
    same_shape,
    scaled,
)
from splatbus_conformance.trials.moves.survey import first_view
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show, whole
from splatbus_conformance.wire.messages import Json, camera_pose, encode, intrinsics
from splatbus_conformance.wire.sockets import Connection

SHOWS = ("1.1", "frames", "pixels")
LENSES = (*SHOWS, "capability:intrinsics")
LARGEST: int = LIMITS["max_image_size"]
WHOLE = 0.99
"""The share of the pixels that have to be right."""
LEAST, MOST = LIMITS["min_lens"], LIMITS["max_lens"]
ASKED = (0, 1, -1, 2**31)
BAD_TAGS: tuple[Any, ...] = (
    *(it.message["tag"] for it in examples("camera_pose", "1.1")[1] if it.pointer == "/tag"),
    *(True, [], ["t"], {}),
)
FAR_SHAPES = ((1, 1), (2, 1), (1, 2), (LARGEST, 1), (1, LARGEST), (LARGEST, 2 * LARGEST // 3))


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


@check("CAM-5", on={SERVER: LENSES})
def check_images_are_seen_through_the_lens(trial: ServerTrial) -> None:
    """Intrinsics for images of every size that has the shape of the server's, also rounded as far
    as it may be, with other focal lengths, principal points and clipping planes.
    """
    first = first_view(trial)
    size = first.camera.width, first.camera.height
    listed = [
        lens_of(first, *size, 1.3, 0.8, 0.1, -0.05),
        *(lens_of(first, w, h, 0.9, 1.1, 0.0, 0.02) for w in (854, 1920) for h in fitting(w, size)),
        lens_of(first, 2 * size[0], 2 * size[1], 1.0, 1.0) | _cutting(first),
    ]
    session = ImageSession(trial)
    before = session.look()
    for lens in trial.each(listed, drawn_lenses(first), quick=8, full=500):
        told = f"the intrinsics {show(lens)} for images of {size[0]}×{size[1]}"
        errors, _ = _posed(session, elsewhere(trial), intrinsics=lens)
        trial.expect(not errors, "refused", f"{told} were answered by {show(errors)}")
        seen, wanted = session.look(intrinsics=lens), scaled(lens, size)
        expect_in_force(trial, seen.frame, wanted, told)
        _expect_seen_so(trial, before, seen, seen.camera._replace(**wanted), told)


def _posed(session: ImageSession, camera: Pose, **members: Any) -> tuple[list[Json], bool]:
    """The errors that come of a pose with these members, and whether what follows is answered."""
    pose = camera_pose(*camera) | members
    return errors_after(session.trial, session.poser, encode(pose))


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


@check("CAM-6", on={SERVER: LENSES})
def check_refuses_lenses_of_another_shape(trial: ServerTrial) -> None:
    """Intrinsics whose shape is off by just as much as it may not be, and by more, in poses that
    move the camera: no part of them is applied.
    """
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    good = lens_of(first, *size)
    session.look(intrinsics=good)
    for width, height in trial.each(list(dict.fromkeys(other_shapes(size)))):
        told = f"a pose with intrinsics for {width}×{height}, of images of {size[0]}×{size[1]},"
        known = len(session.frames)
        bad = lens_of(first, width, height, 0.7, 0.7, 0.1, 0.1)
        errors, answered = _posed(session, _turned(trial), intrinsics=bad, tag="refused")
        trial.expect(answered, "no-reply", f"{told} and the next request was not answered")
        expect_error(trial, errors, "invalid_message", "/intrinsics", told)
        applied = _applied(session, known)
        trial.expect(not applied, "applies", f"{told} was refused and applied: {applied}")
        expect_in_force(trial, session.frames[-1], scaled(good, size), f"{told} was refused")


@check("CAM-7", on={SERVER: LENSES})
def check_keeps_the_lens_in_force(trial: ServerTrial) -> None:
    """Poses with intrinsics, and then whatever leaves them in force: poses without them, of the
    Gaussians too, those of a client without control, and those that are refused.
    """
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    own = {name: first.frame["camera"][name] for name in LENS}
    expect_in_force(trial, session.look().frame, own, "nobody sent intrinsics")
    other = further(trial, session.poser)
    lens = lens_of(first, *size, 0.75, 0.75)
    foreign = lens_of(first, *size, 2.0, 2.0)
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
                expect_in_force(trial, frame, wanted, f"intrinsics were sent, and {moment}")


def _goes_on(trial: ServerTrial, sender: Connection, message: Json) -> bool:
    """Whether a server answers after this, which it may also close for (POS-6, CAM-9)."""
    trial.viewer.say(sender, message)
    return answers(trial, sender)


@check("CAM-8", on={SERVER: ("1.1", "capability:intrinsics")})
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


@check("CAM-9", on={SERVER: SHOWS})
def check_keeps_the_former_camera(trial: ServerTrial) -> None:
    """Poses whose tag or intrinsics are none, of which no part may be applied."""
    first, session = first_view(trial, 0.0), ImageSession(trial)
    size = first.camera.width, first.camera.height
    good = lens_of(first, *size)
    has_lens = trial.facts.grants("intrinsics")
    broken = [("tag", value) for value in BAD_TAGS]
    if has_lens:
        broken += [("intrinsics", value) for value in bad_lenses(good)]
        session.look(intrinsics=good)
    for name, value in trial.each(broken):
        known = len(session.frames)
        _, answered = _posed(session, _turned(trial), **{name: value})
        what = f"a pose with the {name} {show(value)}"
        if not answered:
            trial.judge(session.end(), what)
            trial.peer.close_all()
            session = ImageSession(trial)
            session.look(**({"intrinsics": good} if has_lens else {}))
            continue
        applied = _applied(session, known)
        if has_lens:
            applied = applied or in_force(session.frames[-1], scaled(good, size))
        trial.judge("applies" if applied else "keeps", f"{what}; {applied}" if applied else what)


@check("CAM-10", on={SERVER: SHOWS})
def check_uses_no_lens_that_was_not_granted(trial: ServerTrial) -> None:
    """A client that did not ask for `intrinsics` sends some, of two shapes."""
    offered = [it for it in trial.viewer.capabilities["msg"] if it != "intrinsics"]
    session = ImageSession(trial, capabilities=offered)
    own = {name: session.frames[-1]["camera"][name] for name in LENS}
    for lens in trial.each([intrinsics(*trial.facts.size), NARROW]):
        known = len(session.frames)
        errors, goes_on = _posed(session, _turned(trial), intrinsics=lens)
        what = f"a pose with the lens {show(lens)}, which was not granted"
        trial.expect(goes_on, "no-longer-served", f"{what}: the next request was not answered")
        other = next(filter(None, (in_force(it, own) for it in session.nudged(known - 1))), "")
        trial.expect(not other, "lens-in-force", f"{what}; {other}")
        trial.judge("reports" if errors else "ignores", what)


def _turned(trial: ServerTrial) -> Pose:
    """A camera that is moved and turned, so that a part of it alone is seen."""
    position, rotation = elsewhere(trial)
    return Pose(position, turned_about(rotation, (1, -2, 3), 0.25))


def _applied(session: ImageSession, known: int) -> str:
    """What was applied of a pose that was refused, by the frames since and the one before; nothing
    if nothing was.
    """
    former, *frames = session.nudged(known - 1)
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
