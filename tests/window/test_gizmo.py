"""Where the handles are, and where what they hold is put."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("imgui_bundle", reason="the extra [window] is not installed")

from splatbus_viewer.window.gizmo import from_eye, placed
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose, Vector

UNITS = st.floats(-1, 1)
PLACES = st.tuples(*(st.floats(-1e6, 1e6),) * 3)


@st.composite
def rotations(draw: st.DrawFn) -> tuple[float, float, float, float]:
    numbers = np.array([draw(UNITS), draw(UNITS), draw(UNITS), 1.5])
    x, y, z, w = (numbers / np.linalg.norm(numbers)).tolist()
    return x, y, z, w


@given(PLACES, rotations(), st.floats(1e-3, 1e3), st.tuples(UNITS, UNITS, UNITS))
def test_what_was_not_moved_is_where_it_was(
    place: Vector, rotation: tuple[float, float, float, float], scale: float, middle: Vector
) -> None:
    eye = (place[0] + 1.0, place[1] - 2.0, place[2] + 0.5)
    before = Placement("chair", Pose(place, rotation), scale)
    matrix = from_eye(before, middle, eye).astype(np.float32).astype(np.float64)  # the gizmo's
    after = placed("chair", matrix, middle, eye)
    near = 1e-5 * (3.0 + scale)  # however far from the origin
    assert np.allclose(after.pose.position, place, rtol=0, atol=near)
    assert abs(np.dot(after.pose.rotation, rotation)) > 1 - 1e-6
    assert after.scale == pytest.approx(scale, rel=1e-5)


def test_a_handle_in_the_middle_turns_an_object_about_its_middle() -> None:
    middle, eye = (2.0, 0.0, 0.0), (0.0, 0.0, -3.0)
    before = Placement("chair", Pose((1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    matrix = from_eye(before, middle, eye)
    assert matrix[:3, 3].tolist() == [3.0, 0.0, 3.0]  # the handle, from the eye
    half = np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1]])  # half a turn about y
    matrix[:3, :3] = half
    after = placed("chair", matrix, middle, eye)
    assert np.allclose(after.pose.position, (5.0, 0.0, 0.0))
