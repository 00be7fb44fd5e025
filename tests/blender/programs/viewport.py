"""What a viewport wants of the server: there is one in the background, too, which nobody sees."""

import bpy
import numpy as np
from splatbus_blender import compositing, engine, properties, service, viewing
from splatbus_blender.core import poses
from splatbus_blender.drawing import LOOKS
from splatbus_wire.poses import view_matrix

WIDTH, HEIGHT = 64, 48
scene = bpy.context.scene
properties.register()
engine.register()
scene.render.engine = "BLENDER_WORKBENCH"
scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
bpy.ops.render.render()  # before, there is no GPU, and a view that is updated crashes
region, space = service.viewport()
view = space.region_3d


def seen(wanted, point):
    """Where the wire sees a point of Blender's world, as parts of the view."""
    x, y, z = point
    matrix = view_matrix(poses.camera_pose(wanted.camera))
    a, b, c = (
        sum(m * n for m, n in zip(matrix[4 * i : 4 * i + 4], (x, -z, y, 1), strict=True))
        for i in range(3)
    )
    lens = wanted.lens
    return (lens.fx * a / c + lens.cx) / lens.width, (lens.fy * b / c + lens.cy) / lens.height


def check(wanted, problems):
    assert not problems, problems
    assert wanted.size == (region.width, region.height)
    for point in ((0, 0, 0), (1, -2, 0.5), (-1, 0.3, 2)):
        x, y, _, w = view.window_matrix @ view.view_matrix @ _vector(point)
        theirs = (x / w + 1) / 2, (1 - y / w) / 2
        assert np.allclose(seen(wanted, point), theirs, atol=1e-5), (point, theirs)


def _vector(point):
    return type(view.view_location)((*point, 1))


def check_free_views():
    for turn in ((0.4, 0.1, 0.3, 0.85), (0.9, 0.2, -0.1, 0.3)):
        view.view_perspective = "PERSP"
        view.view_location, view.view_distance = (1, 2, 3), 12
        x, y, z, w = poses.unit_quaternion(turn)
        view.view_rotation = w, x, y, z
        view.update()
        wanted, problems = viewing.through_region(scene, region, space)
        check(wanted, problems)
        assert wanted.lens.near == space.clip_start


def check_the_view_of_a_camera():
    view.view_perspective = "CAMERA"
    scene.camera.data.shift_x, scene.camera.data.clip_end = 0.1, 77
    view.view_camera_zoom = 10
    bpy.context.view_layer.update()
    view.update()
    wanted, problems = viewing.through_region(scene, region, space)
    check(wanted, problems)
    assert wanted.camera.position == tuple(scene.camera.location)
    assert wanted.lens.far == 77


def check_an_orthographic_view():
    view.view_perspective = "ORTHO"
    view.update()
    wanted, problems = viewing.through_region(scene, region, space)
    assert wanted.camera is None
    assert "perspective" in problems[0]


def check_depth_is_looked_at_unless_colour_alone_is_shown():
    for look in LOOKS:
        scene.splatbus.show = look
        assert service.looks_at_depth(scene) == (look != "COLOR"), look
    scene.splatbus.show = "COLOR"
    compositing.set_up(scene, encoded=True)
    assert service.looks_at_depth(scene)
    scene.render.use_compositing = False


for name, each in [*globals().items()]:
    if name.startswith("check_"):
        each()
        print(name)
engine.unregister()
properties.unregister()
