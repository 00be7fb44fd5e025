"""Intrinsics that a client sends, and what frames say of them (spec 1.1 section 6.2)."""

from typing import Any

from splatbus_conformance.images.captured import CapturedFrame
from splatbus_conformance.trials import viewpoint
from splatbus_conformance.trials.moves.image_session import LENS
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import is_number, show, within
from splatbus_conformance.wire.messages import Json

SINGLE = 2.0**-22
"""Two units in the last place of single precision, relative, which a server may count in."""


def scaled(lens: Json, size: tuple[int, int]) -> dict[str, Any]:
    """What a server whose images have this size makes of intrinsics (CAM-5)."""
    told = viewpoint.scaled(lens, *size)
    return {name: told[name] for name in LENS}


def same_shape(width: int, height: int, size: tuple[int, int]) -> bool:
    """Whether intrinsics of this size fit images of the other (CAM-6)."""
    return abs(height * size[0] - width * size[1]) < max(width, height, *size)


def lens_of(
    photograph: CapturedFrame,
    width: int,
    height: int,
    longer: float = 1.25,
    taller: float = 1.25,
    right: float = 0.0,
    down: float = 0.0,
) -> Json:
    """Intrinsics for an image of so many pixels: those of an image, but for factors for fx and fy,
    and parts of the size by which the principal point is moved.
    """
    camera = photograph.camera
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
    for name, wanted in lens.items():
        told = within(frame, "camera", name)
        if not (is_number(told) and abs(told - wanted) <= SINGLE * abs(wanted)):
            return f"{name} is {show(told)}, and {wanted!r} was to be expected"
    return ""


def expect_in_force(trial: ServerTrial, frame: Json, lens: dict[str, float], what: str) -> None:
    """A frame's camera is as these intrinsics say."""
    wrong = in_force(frame, lens)
    trial.expect(not wrong, "other-intrinsics", f"{what}: of the frame's camera {wrong}")
