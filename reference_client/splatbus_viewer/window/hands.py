"""What mouse and keys do to the camera, as Dear ImGui tells of them."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from splatbus_viewer.window import cameras
from splatbus_viewer.window.cameras import Eye
from splatbus_viewer.window.choices import Choices

RADIANS_A_UNIT = math.pi / 900
"""Of the mouse's way, in units of the desktop."""
NEARER_A_STEP = 0.9
FASTER = 4.0
ROLL_A_SECOND = math.radians(60)
HELP = (
    ("drag", "turn"),
    ("middle or Shift + drag", "move sideways"),
    ("wheel", "go nearer, or faster on foot and in the air"),
    ("W A S D, E Q", "go; up and down (Shift: faster)"),
    ("Z X", "roll, in the air"),
    ("N B", "next and previous camera of the scene"),
    ("1 2 3 4", "colour, depth, normals, composite"),
    ("Tab", "hide and show the panels"),
    ("P", "screenshot"),
)
_Key = imgui.Key


def steer(choices: Choices, seconds: float) -> bool:
    """Move the eye as the user does; returns whether keys are held, so that it goes on.

    Args:
        choices: whose eye it is.
        seconds: since it was asked last.
    """
    io, kind = imgui.get_io(), choices.kind
    eye = choices.eye
    if not io.want_capture_mouse:
        dx, dy = io.mouse_delta.x, io.mouse_delta.y
        shifts = imgui.is_mouse_down(2) or (imgui.is_mouse_down(0) and io.key_shift)
        if (dx or dy) and shifts:
            unit = eye.distance * RADIANS_A_UNIT
            eye = cameras.moved(eye, kind, -unit * dx, -unit * dy, 0.0)
        elif (dx or dy) and imgui.is_mouse_down(0):
            eye = cameras.turned(eye, kind, RADIANS_A_UNIT * dx, RADIANS_A_UNIT * dy)
        if io.mouse_wheel:
            factor = NEARER_A_STEP**io.mouse_wheel
            # In the air and on foot the distance is the speed.
            eye = cameras.nearer(eye, factor) if kind == "orbit" else faster(eye, factor)
    right = down = forward = roll = 0.0
    if not io.want_capture_keyboard:
        right = _held(_Key.d) - _held(_Key.a)
        forward = _held(_Key.w) - _held(_Key.s)
        down = _held(_Key.q) - _held(_Key.e)
        roll = (_held(_Key.x) - _held(_Key.z)) if kind == "fly" else 0.0
    is_going = bool(right or down or forward or roll)
    if is_going:
        way = seconds * eye.distance * (FASTER if io.key_shift else 1.0)
        eye = cameras.moved(eye, kind, way * right, way * down, way * forward)
        if roll:
            eye = cameras.rolled(eye, roll * ROLL_A_SECOND * seconds)
    if eye != choices.eye:
        choices.moved_to(eye)
    return is_going


def faster(eye: Eye, factor: float) -> Eye:
    """Return the eye with a pivot so many times as near, and so many times as fast."""
    return eye._replace(distance=max(eye.distance / factor, cameras.NEAREST))


def pressed(key: imgui.Key) -> bool:
    """Whether a key went down since the last image, and no field of the interface takes it."""
    return not imgui.get_io().want_text_input and imgui.is_key_pressed(key, repeat=False)


def _held(key: imgui.Key) -> float:
    return float(imgui.is_key_down(key))
