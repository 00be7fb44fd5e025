"""Poses and lenses of the extension, against those that Blender computes itself."""

import itertools
import math
import random

import bpy
from splatbus_blender import reading
from splatbus_blender.core import lens, poses
from splatbus_wire.poses import view_matrix

MODES = ("QUATERNION", "AXIS_ANGLE", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
chance = random.Random(7)
scene = bpy.context.scene
view_layer = bpy.context.view_layer


def turn(thing, mode):
    thing.rotation_mode = mode
    angles = [chance.uniform(-4, 4) for _ in range(4)]
    if mode == "QUATERNION":
        thing.rotation_quaternion = angles
    elif mode == "AXIS_ANGLE":
        thing.rotation_axis_angle = angles
    else:
        thing.rotation_euler = angles[:3]


def moved(thing, mode, scale=(1, 1, 1)):
    thing.location = [chance.uniform(-50, 50) for _ in range(3)]
    thing.scale = scale
    turn(thing, mode)
    view_layer.update()
    return thing


def near(a, b, within):
    assert abs(a - b) <= within, (a, b)


def complaint(read, thing):
    try:
        read(thing)
    except ValueError as wrong:
        return str(wrong)
    return ""


def new(name, data=None):
    thing = bpy.data.objects.new(name, data)
    scene.collection.objects.link(thing)
    return thing


def check_view(camera):
    """A point of the world lies in the camera's axes where Blender has it; the wire's y is down."""
    pose = poses.camera_pose(reading.placed(camera))
    ours = view_matrix(pose)
    theirs = camera.matrix_world.normalized().inverted()
    for _ in range(5):
        x, y, z = (chance.uniform(-10, 10) for _ in range(3))
        wire = (x, -z, y, 1)
        seen = [sum(ours[4 * i + j] * wire[j] for j in range(4)) for i in range(3)]
        row = [sum(theirs[i][j] * (x, y, z, 1)[j] for j in range(4)) for i in range(3)]
        for a, b in zip(seen, (row[0], -row[1], -row[2]), strict=True):
            near(a, b, 1e-4)


def check_channels_are_exact():
    thing = new("own")
    for mode in MODES * 5:
        moved(thing, mode, [chance.uniform(0.1, 3) for _ in range(3)])
        got = reading.placed(thing)
        assert got.position == tuple(thing.location)
        assert got.rotation == reading.rotation(thing), mode
        assert got.scale == tuple(thing.scale)
        near(math.hypot(*got.rotation), 1, 1e-15)


def check_parents_and_constraints_count():
    parent, child, follower = moved(new("parent"), "ZYX"), new("child"), new("follower")
    child.parent = parent
    moved(child, "YXZ")
    got = reading.placed(child)
    assert got.position == tuple(child.matrix_world.translation) != tuple(child.location)
    follower.constraints.new("COPY_TRANSFORMS").target = parent
    view_layer.update()
    assert reading.placed(follower).position == tuple(parent.location)
    parent.delta_location = (1, 2, 3)
    view_layer.update()
    assert reading.placed(parent).position == tuple(parent.matrix_world.translation)


def check_views():
    camera = new("eye", bpy.data.cameras.new("eye"))
    parent = moved(new("dolly"), "QUATERNION")
    for mode in MODES:
        check_view(moved(camera, mode, (1, 2, 0.5)))
    camera.parent = parent
    check_view(moved(camera, "XYZ"))


def check_lenses():
    data = bpy.data.cameras.new("lens")
    camera = new("lens", data)
    render = scene.render
    depsgraph = bpy.context.evaluated_depsgraph_get()
    fits, sizes = ("AUTO", "HORIZONTAL", "VERTICAL"), ((320, 180), (180, 320), (100, 100), (99, 64))
    aspects, parts = ((1, 1), (2, 1), (1, 1.5)), (100, 50)
    for fit, size, aspect, part in itertools.product(fits, sizes, aspects, parts):
        data.sensor_fit, data.sensor_width, data.sensor_height = fit, 36, 20
        data.lens = chance.uniform(10, 90)
        data.shift_x, data.shift_y = chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5)
        data.clip_start, data.clip_end = 0.25, 50
        render.resolution_x, render.resolution_y = size
        render.pixel_aspect_x, render.pixel_aspect_y = aspect
        render.resolution_percentage = part
        view_layer.update()  # Blender computes from what is evaluated
        film = reading.film(render)
        theirs = camera.calc_matrix_camera(
            depsgraph, x=film.width, y=film.height, scale_x=aspect[0], scale_y=aspect[1]
        )
        ours = lens.camera_lens(reading.optics(data), film)
        again = lens.region_lens(theirs, film.width, film.height, 0.25, 50)
        for name, a, b in zip(ours._fields, ours, again, strict=True):
            assert abs(a - b) <= 4e-6 * max(abs(b), film.width), (name, a, b, fit, size, aspect)
    data.type = "ORTHO"
    assert "perspective" in complaint(reading.optics, data)


for name, check in [*globals().items()]:
    if name.startswith("check_") and name != "check_view":
        check()
        print(name)
