"""The demo, beside `tests/pair`, which compares its images with the closed form."""

from __future__ import annotations

import numpy as np
import pytest
from splatbus_renderer.demo import OBJECTS, camera_of, scene_at
from splatbus_renderer.raycast import Raycaster
from splatbus_renderer.scene import default_scene
from splatbus_schemas import LIMITS
from splatbus_server.control import Poses
from splatbus_server.view import Intrinsics, View
from splatbus_wire.messages import Placement
from splatbus_wire.poses import Pose

from tests.pair.known_scene import is_right, showing
from tests.pair.rig import MOST_SECONDS


def test_time_stands_still_where_it_was_set_and_plays_on_when_that_client_goes() -> None:
    """[TIM-2, IMG-10, CTL-3]"""
    with showing(32, 24, -90.0) as (_, tap), tap.session() as watching:
        with tap.session() as setting:
            setting.send_time(9.0)
            setting.viewport_size(MOST_SECONDS)
            times = [0.0]
            while times[-1] != 4.0:
                with watching.next_frame(MOST_SECONDS) as frame:
                    times.append(frame.time)
                    assert is_right(frame, -90.0)
            with pytest.raises(TimeoutError):
                watching.next_frame(0.3)
        for _ in range(3):
            with watching.next_frame(MOST_SECONDS) as frame:
                times.append(frame.time)
    assert times[-1] != 4.0


def test_the_scene_lists_what_can_be_seen() -> None:
    """[SCN-2]"""
    *_, last = spheres = default_scene().spheres
    for listed, its in zip(
        OBJECTS, ((*spheres[:2], *spheres[3:5], last), spheres[2:3]), strict=True
    ):
        centers = [sphere.center for sphere in its]
        assert listed.gaussians == len(centers)
        assert listed.bounds == (
            tuple(np.min(centers, axis=0).tolist()),
            tuple(np.max(centers, axis=0).tolist()),
        )


@pytest.mark.parametrize("extreme", [LIMITS["min_lens"], LIMITS["max_lens"]])
@pytest.mark.parametrize("distance", [LIMITS["max_position"], -LIMITS["max_position"], 1e-300])
@pytest.mark.parametrize("scale", [LIMITS["min_scale"], LIMITS["max_scale"]])
def test_no_pose_and_no_lens_stops_it(extreme: float, distance: float, scale: float) -> None:
    """Whatever is valid is rendered, if only as nothing [CAM-4, OBJ-1, POS-2]."""
    turned = Pose((distance, distance, -distance), (0.0, 0.6, 0.0, 0.8))
    camera = Pose((distance, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    objects = {each.id: Placement(each.id, turned, scale) for each in OBJECTS}
    lens = Intrinsics(*[extreme] * 3, 30.0, LIMITS["min_lens"], LIMITS["max_lens"])
    view = View(Poses(camera, objects), lens, 32, 24, frozenset(("color", "depth")), 1)
    image = Raycaster(32, 24).render(scene_at(0.0, view), camera_of(view))
    assert np.isfinite(image.color).all()
