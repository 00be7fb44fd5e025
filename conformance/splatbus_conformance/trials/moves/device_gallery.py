"""What a server of 1.0 stores in CUDA memory, and of which pose an image there is.

The images are read through the handles of its init packets, on a GPU or in the stand-in's memory.
1.0 names no camera of an image. Of the scene of SCENE.md the lens is found from the image of a
camera at the origin, where no digits are lost, and each pixel tells. Of any other, a pose that was
sent plainly tells how it looks from there; one that is spelt in another way has to look the same.
"""

import base64
import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from splatbus_conformance.cases.valid.poses import Pose
from splatbus_conformance.images.captured import CapturedFrame, shows_the_scene
from splatbus_conformance.images.hard_views import HardView, turned_about
from splatbus_conformance.images.known_scene import SceneState
from splatbus_conformance.images.lens_finding import find_lens
from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.images.memory.reading import MOST_PIXELS, Pixels
from splatbus_conformance.images.pinhole import STILL, Camera, ObjectPlacement, rigid
from splatbus_conformance.images.reprojection import POSES, QUATERNIONS, ROWS, Misreading
from splatbus_conformance.rules.v1_0.ini import layout
from splatbus_conformance.trials.controls import CAMERA_REQUEST
from splatbus_conformance.trials.moves.announced import announced
from splatbus_conformance.trials.moves.frame_capture import AT_REST, aside
from splatbus_conformance.trials.moves.nudging import AGAIN_SECONDS
from splatbus_conformance.trials.moves.pose_error import pose_in
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, GLANCE_SECONDS
from splatbus_conformance.wire.json_values import within
from splatbus_conformance.wire.messages import Json, camera_pose, encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.sockets import Connection

IMAGES, PAUSE_SECONDS = 8, 0.05
MEMBERS = {"mem_color": ("offsetColor", 4), "mem_depth": ("offsetDepth", 1)}
"""Where each plane is named and begins, and how many numbers of it are a pixel's."""
AT_ORIGIN = AT_REST
UPRIGHT = AT_ORIGIN.rotation
LEFT, RIGHT = Pose((-0.5, 0.1, -0.75), UPRIGHT), Pose((0.75, -0.2, -1.0), UPRIGHT)
"""Cameras that see the scene of SCENE.md, and no image of the one is one of the other."""
ASKEW = Pose((-0.3, 0.15, -0.5), turned_about(UPRIGHT, (0.3, 0.5, 0.8), 0.2))
"""That its rotation was read with the scalar first shows, too: it looks the same way then."""
MOVED = Pose((0.03, 0.02, 0.01), turned_about(UPRIGHT, (0.3, 0.5, 0.8), 0.02))
"""To there the Gaussians move a little, so that there is a new image."""
BESIDE = aside(aside(AT_ORIGIN))
"""What shows that images do come of poses, where one does not."""
NOWHERE = Camera(rigid(*AT_ORIGIN), 1.0, 1.0, 0.0, 0.0, 1, 1, 0.01, 100.0)
"""For images whose lens is not known."""
SETTLED_SECONDS, TIMES, MOST_SECONDS = 0.1, 3.0, 1.5
"""An image is taken for the one of a pose that has not changed for so long, and for so many times
as long as it took to change, up to so long."""
LOOKS = 3
"""At a pose, and at another beside it: what shows the first time beside it may be the image of this
one, late, and no other comes of this one then.
"""
RESTLESS = 20
"""Images that change so often after a pose change by themselves."""
SLACK = 0.05
"""The share of the pixels by which poses are told apart that may be others in images of one pose:
the sums of a GPU come in any order."""
LEAST_PIXELS = 16
"""Fewer tell no poses apart."""
COLOR_STEP, DEPTH_STEP = 2 / 255, 1e-3
NUDGE = camera_pose(*MOVED, kind="point_cloud_pose")


@contextlib.contextmanager
def reading(trial: ServerTrial) -> Iterator[Callable[[], CapturedFrame]]:
    """What reads the buffers of 1.0, once the server has drawn an image: what lies there at one
    moment may be of two images (section 5.4).
    """
    told = announced(trial).packet
    broken = [found for found in layout(told) if found.breach]
    if broken or told["meta"]["w"] * told["meta"]["h"] > MOST_PIXELS:
        why = broken[0].breach if broken else "its images are too large"
        trial.not_observable(f"its init packet is none to read images by: {why}")
    handles = {name: base64.b64decode(told[name]) for name in (*MEMBERS, "evt_done")}
    width, height = int(told["meta"]["w"]), int(told["meta"]["h"])
    device = _device_of(trial, told)

    def plane(member: str) -> Pixels:
        offset, numbers = MEMBERS[member]
        begin, size = int(told["meta"].get(offset, 0)), 4 * numbers * width * height
        try:
            data = device.read(handles[member], begin, size, handles["evt_done"])
        except ValueError as error:
            trial.not_observable(f"what {member} names cannot be read: {error}")
        return np.frombuffer(data, np.dtype("<f4")).reshape(height, width, numbers)[::-1]

    def both() -> CapturedFrame:
        planes = plane("mem_color"), plane("mem_depth")[..., 0]
        return _seen_from(AT_ORIGIN, NOWHERE, CapturedFrame({}, NOWHERE, *planes, {}))

    try:
        if not trial.wait(lambda: _is_drawn(both())):
            trial.not_observable(f"in {EFFECT_SECONDS:g} s it wrote no image")
        yield both
    finally:
        for handle in handles.values():
            device.forget(handle)


def _device_of(trial: ServerTrial, told: Json) -> Device:
    """Where its images lie: the server's count of devices need not be that of the harness."""
    assert trial.device is not None, "a check of device memory needs a device"
    uuid = within(told, "memory", "deviceUuid")
    try:
        return trial.device if uuid is None else trial.device.named(uuid)
    except ValueError as error:
        trial.not_observable(str(error))


def _is_drawn(image: CapturedFrame) -> bool:
    """Somebody has written both planes: not all of them is poison."""
    planes = image.color, image.depth
    return all(bool((plane.view(np.uint32) != 0xFFFFFFFF).any()) for plane in planes)


class DeviceGallery:
    """Moves the camera of a server of 1.0, and reads what comes of it.

    Attributes:
        read: reads what is stored; another one where the server was started anew.
    """

    legacy = True

    def __init__(self, trial: ServerTrial, read: Callable[[], CapturedFrame]) -> None:
        self.trial = trial
        self.read = read
        self._pace = 0.0
        self._last = read()
        self._plain: dict[HardView, CapturedFrame] = {}

    # The images

    def some(self) -> Iterator[CapturedFrame]:
        """Images while the camera moves."""
        for number in range(IMAGES):
            self.trial.move()
            self.trial.rest(PAUSE_SECONDS)
            yield self.read()._replace(frame={"seq": number})

    def take(self, camera: Pose, scene: Pose) -> CapturedFrame:
        """What the server stores for a camera, with the Gaussians there; skips the check where it
        does not show the scene that is known.
        """
        if self.lens is None:
            self._not_known()
        return _seen_from(camera, self.lens, self._stored(HardView(camera, scene)))

    def judge(self, wrong: Sequence[Misreading], *_: float) -> None:
        """The requirement is violated if the image of a camera at the origin shows the known scene
        by one of these wrong readings of what is stored; or, by one of the pose, another image.
        """
        if self.lens is None:
            for each in wrong:
                unlike = _lens_of(_read_as(self._origin, each)) is None
                self.trial.expect(unlike, each.code, f"the images fit {each.words}")
            self._not_known()
        if not {*wrong} <= {*POSES, *QUATERNIONS}:
            return
        image = self.take(ASKEW, AT_REST)
        if shows_the_scene(image):
            return
        view, rest = image.view(), _seen_from(AT_REST, self.lens, image).view()
        for each in wrong:
            read = image._replace(camera=self.lens._replace(pose=each.pose(view)))
            for scene in (STILL, ObjectPlacement(each.pose(rest))):  # read so, too, perhaps
                fits = shows_the_scene(read, self._set(scene))
                self.trial.expect(not fits, each.code, f"the images fit {each.words}")
        self.trial.not_observable(f"the image of a camera at {ASKEW} is none of it, nor fits these")

    def _set(self, scene: ObjectPlacement) -> SceneState:
        """What there is to see with the Gaussians there: who moves those moves no other object."""
        return self.trial.facts.setting({}, scene)

    def _not_known(self) -> NoReturn:
        self.trial.not_observable("the server does not show the scene of conformance/SCENE.md")

    @cached_property
    def _origin(self) -> CapturedFrame:
        """The image of a camera at the origin."""
        self._stored(HardView(aside(AT_ORIGIN), AT_REST))
        return self._stored(HardView(AT_ORIGIN, AT_REST))

    @cached_property
    def lens(self) -> Camera | None:
        """The camera of an image at the origin, where that shows the scene that is known."""
        return _lens_of(self._origin)

    def _stored(
        self, stage: HardView, *spelled: Json, right: Callable[[CapturedFrame], Any] | None = None
    ) -> CapturedFrame:
        """The image that comes of these poses, or of what is `spelled` in place of them, once it
        stays; the requirement is violated if none does, and one of another camera did that was
        sent in between.

        Where it is told what is `right`, it gives the server time until an image is, for one that
        comes before may have been begun when not all had arrived.
        """
        said = spelled or _said(stage)
        shown = False
        for _ in range(LOOKS):
            if came := self._comes(said, right):
                return came
            shown = self._comes(_said(HardView(BESIDE, AT_REST))) is not None
        what = f"no image in CUDA memory came of the camera at {stage.camera}"
        self.trial.expect(not shown, "no-image", what)
        return self.trial.not_observable(what)

    def _comes(
        self, said: Sequence[Json], right: Callable[[CapturedFrame], Any] | None = None
    ) -> CapturedFrame | None:
        """The image that comes of this, once it stays and is right, if one does in time; else the
        one that has come. Skips the check where images change all the time.
        """
        self._pace /= 2.0  # it was held up once, perhaps
        began = changed = time.monotonic()
        changes, sent, former, now = 0, 0.0, self._last, self.read()
        looked_at, until = 0.0, self.trial.peer.clock() + EFFECT_SECONDS
        while self.trial.peer.clock() < until and changes < RESTLESS:
            if time.monotonic() - sent >= AGAIN_SECONDS:
                # In one piece, so that hardly an image is begun when half of it has arrived.
                self.trial.mover().send(b"".join(packet(encode(message)) for message in said))
                sent = time.monotonic()
            self.trial.rest(GLANCE_SECONDS)
            before, now = now, self.read()
            if not _same(before, now):
                changes, changed = changes + 1, time.monotonic()
                self._pace = max(self._pace, changed - began)
            lasts = min(max(SETTLED_SECONDS, TIMES * self._pace), MOST_SECONDS)
            settled = time.monotonic() - changed > (lasts if right is None else SETTLED_SECONDS)
            if settled and looked_at != changed and not _same(former, now):
                if right is None or right(now):
                    break
                looked_at = changed
        else:
            if _same(former, now):
                return None
            if not looked_at or changes >= RESTLESS:
                self.trial.not_observable("its images change all the time")
        self._last = now
        return now


def _said(stage: HardView) -> tuple[Json, Json]:
    return camera_pose(*stage.scene, kind="point_cloud_pose"), camera_pose(*stage.camera)


def _same(some: CapturedFrame, others: CapturedFrame) -> bool:
    pairs = (some.color, others.color), (some.depth, others.depth)
    return all(a.tobytes() == b.tobytes() for a, b in pairs)


def _seen_from(at: Pose, lens: Camera, image: CapturedFrame) -> CapturedFrame:
    """The same image, as one of a camera there."""
    named: Json = {"position": list(at.position), "rotation": list(at.rotation)}
    camera = lens._replace(pose=rigid(*at))
    return image._replace(frame={"seq": 0, "camera": named}, camera=camera)


def _read_as(image: CapturedFrame, reading: Misreading) -> CapturedFrame:
    """What an image is, if this is how it was stored."""
    view = image.view()
    color = image.color.astype(np.float64)
    color = reading.depth(view._replace(depth=color)) if reading in ROWS else color
    color_, depth = (plane.astype(np.float32) for plane in (color, reading.depth(view)))
    return image._replace(color=color_, depth=depth)


def _lens_of(image: CapturedFrame) -> Camera | None:
    """The lens of an image of a camera at the origin, if that shows the scene that is known."""
    planar = image.planar()
    found = _searched(planar.tobytes(), planar.shape)
    known = found and shows_the_scene(_seen_from(AT_ORIGIN, found, image))
    return found if known else None


@lru_cache(maxsize=4)
def _searched(planar: bytes, shape: tuple[int, ...]) -> Camera | None:
    """Once for an image that check after check looks at."""
    return find_lens(rigid(*AT_ORIGIN), np.frombuffer(planar).reshape(shape))


class DeviceSteering(DeviceGallery):
    """Tells of which pose an image is, of a scene that stands still.

    Attributes:
        left, right, askew: cameras that look around where the server's first one is.
    """

    def __init__(self, trial: ServerTrial, read: Callable[[], CapturedFrame]) -> None:
        super().__init__(trial, read)
        # The first camera that the scene comes with; the origin where the server tells none.
        reply = None if self.lens else trial.ask(trial.dial("msg"), CAMERA_REQUEST)
        home = pose_in(reply or {}) or AT_ORIGIN
        self.left, self.right, self.askew = (_before_it(home, it) for it in (LEFT, RIGHT, ASKEW))
        self._at = self.left
        for camera in (self.left, self.right):
            for scene in (AT_REST, MOVED):
                self._learn(HardView(camera, scene))

    def put(self, camera: Pose, code: str = "not-applied", by: Connection | None = None) -> None:
        """As `Steering` has it."""
        if by:
            self.trial.pass_control(by)
        self._at = camera
        shown = self._comes_to_show([HardView(camera, AT_REST)])
        self.trial.expect(shown, code, f"no image is of the camera at {camera}")

    def takes(self, camera: Pose, *spelled: Json) -> str:
        """As `Steering` has it."""
        shown = self._comes_to_show([HardView(camera, AT_REST)], *spelled)
        return "accepts" if shown else self.trial.fate() or "ignores"

    def keeps(self) -> bool:
        """As `Steering` has it."""
        return self._comes_to_show([HardView(self._at, MOVED)], NUDGE) is not None

    def outcome_of(self, payload: bytes, there: Pose | None = None) -> str:
        """As `Steering` has it."""
        outcome = self.trial.outcome_on_msg(self.trial.mover(), packet(payload))
        if outcome not in ("ignores", "reports", "replies"):
            return outcome
        stages = [HardView(it, MOVED) for it in (self._at, there) if it]
        shown = self._comes_to_show(stages, NUDGE)
        return "applies" if shown is None else "keeps" if shown == stages[0] else "accepts"

    def where(self) -> str:
        """As `Steering` has it."""
        return "its images do not tell where the camera is"

    def _learn(self, stage: HardView) -> None:
        """See how the scene looks from there, where that is not known; then look from elsewhere.

        Skips the check where poses that are far apart cannot be told apart.
        """
        if self.lens or stage in self._plain:
            return
        away = stage._replace(camera=self.left if stage.camera == self.askew else self.askew)
        here = self._plain[stage] = self._stored(stage)
        there = self._plain[away] = self._stored(away)
        if _differ(here, there).sum() < LEAST_PIXELS:
            self.trial.not_observable(f"from {stage.camera} all looks as from {away.camera}")

    def _comes_to_show(self, stages: Sequence[HardView], *spelled: Json) -> HardView | None:
        """Which of these the image shows that comes, if any, once the server was told the first, or
        was sent what is `spelled` in place of that.
        """
        for stage in stages:
            self._learn(stage)

        def shown_by(image: CapturedFrame) -> HardView | None:
            return next((it for it in stages if self._is_of(image, it)), None)

        found = shown_by(self._stored(stages[0], *spelled, right=shown_by))
        if found is None and not self.lens:
            self._expect_still(stages[0])
        return found

    def _is_of(self, image: CapturedFrame, stage: HardView) -> bool:
        if not self.lens:
            return self._is_like(image, self._plain[stage])
        scene = self._set(ObjectPlacement(rigid(*stage.scene)))
        return shows_the_scene(_seen_from(stage.camera, self.lens, image), scene)

    def _expect_still(self, stage: HardView) -> None:
        """The positive control: a pose that is sent once more looks as it did before."""
        former = self._plain[stage]
        away = self.right if stage.camera != self.right else self.left
        self._stored(stage._replace(camera=away))
        if not self._is_like(self._stored(stage), former):
            self.trial.not_observable("the scene moves by itself")

    def _is_like(self, image: CapturedFrame, wanted: CapturedFrame) -> bool:
        """Most of the pixels that are others from elsewhere are those that are wanted."""
        telling = np.any([_differ(it, wanted) for it in self._plain.values()], axis=0)
        return bool(_differ(image, wanted).sum() <= SLACK * telling.sum())


def _differ(some: CapturedFrame, others: CapturedFrame) -> NDArray[np.bool_]:
    """(h, w): pixels that hold something else, whatever the rounding."""
    color = np.isclose(some.color, others.color, rtol=0, atol=COLOR_STEP, equal_nan=True)
    depth = np.isclose(some.depth, others.depth, rtol=DEPTH_STEP, atol=0, equal_nan=True)
    found: NDArray[np.bool_] = ~(color.all(axis=-1) & depth)
    return found


def _before_it(at: Pose, pose: Pose) -> Pose:
    """A pose in the axes of a camera, in those of the world."""
    place = rigid(*at).place(np.array(pose.position))
    *axis, w = pose.rotation
    turn = 2.0 * float(np.arctan2(np.linalg.norm(axis), w))
    return Pose(tuple(map(float, place)), turned_about(at.rotation, axis, turn))
