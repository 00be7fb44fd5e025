"""The extension as Blender installs it, beside a server: files, undo, disabling, and back.

    lifecycle.py ARCHIVE

In the background no timer runs: what it would call is called here.
"""

import importlib
import sys
import tempfile
import threading
import time
from pathlib import Path

import bpy
import gpu
import numpy as np

MODULE = "bl_ext.user_default.splatbus"


def service():
    return importlib.import_module(f"{MODULE}.service")


def until(holds):
    end = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end, service().complaints()
        time.sleep(0.01)
        if service().connection is not None:
            service()._turn()


def shows(x):
    """Whether the image is seen from there, through the lens of the scene's camera."""
    bpy.context.view_layer.update()

    def holds():
        image = service().connection.image
        camera = None if image is None else image.camera
        return camera is not None and camera.pose.position[0] == x

    until(holds)


def ours():
    return [each for each in threading.enumerate() if each.name.startswith("splatbus")]


def check_it_connects():
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    bpy.ops.splatbus.connect()
    scene.camera.location.x = 2
    shows(2)
    images, messages, size = service().told()
    assert images.startswith("Images: splatbus-server "), images
    assert messages.startswith("Messages: splatbus-server "), messages
    assert (images[-5:], messages[-5:], size) == (", 1.1", ", 1.1", "64 × 48 pixels")
    assert not service().complaints()


def check_it_goes_online_only_where_blender_may():
    scene, connection = bpy.context.scene, service().connection
    assert not bpy.app.online_access
    scene.splatbus.host = "192.0.2.1"
    said = ""
    try:
        bpy.ops.splatbus.connect()
    except RuntimeError as wrong:
        said = str(wrong)
    assert "192.0.2.1 is not this computer" in said, said
    assert service().connection is connection
    scene.splatbus.host = ""


def check_an_empty_moves_what_it_names():
    empty = bpy.data.objects.new("mover", None)
    bpy.context.scene.collection.objects.link(empty)
    empty.splatbus_object = "default"
    for x in (1, 2):
        empty.location.x = x
        bpy.context.view_layer.update()
        until(lambda x=x: [it.pose.position[0] for it in service().connection.image.objects] == [x])
    bpy.data.objects.remove(empty)


def check_another_file_leaves_it_connected():
    connection = service().connection
    place = str(Path(tempfile.mkdtemp()) / "some.blend")
    bpy.context.scene.splatbus.host = "kept"
    bpy.ops.wm.save_as_mainfile(filepath=place)
    bpy.ops.wm.read_homefile()
    bpy.context.scene.camera.location.x = 3
    shows(3)
    bpy.ops.wm.open_mainfile(filepath=place)
    assert bpy.context.scene.splatbus.host == "kept"
    bpy.context.scene.splatbus.host = ""
    shows(2)
    assert service().connection is connection
    assert bpy.app.timers.is_registered(service()._turn)


def check_an_undo_is_shown():
    scene = bpy.context.scene
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    scene.camera.location.x = 5
    bpy.ops.ed.undo_push(message="after")
    shows(5)
    bpy.ops.ed.undo()
    shows(2)


def check_a_turn_that_fails_is_not_the_last():
    """Blender never calls a timer again that raised; what is wrong is drawn without an image."""
    tell, fault = service().tell, "ZeroDivisionError: division by zero"
    redraw, drawn = service()._redraw, []
    service()._redraw = lambda: drawn.append(service().complaints())
    service().tell = lambda **_: 1 / 0
    assert service()._turn() is not None
    assert fault in drawn[-1]
    service().tell = tell
    assert service()._turn() is not None
    assert fault not in drawn[-1]
    service()._redraw = redraw


def check_what_is_drawn_is_the_image():
    """Over what is bound, once there is a GPU, which the first render with one brings."""
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_WORKBENCH"
    bpy.ops.render.render()
    scene.render.engine = "CYCLES"
    overlay = importlib.import_module(f"{MODULE}.overlay")
    layer = gpu.types.GPUTexture((64, 48), format="SRGB8_A8")
    frame = gpu.types.GPUFrameBuffer(color_slots=layer)
    window = [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1.01, -0.1), (0, 0, -1, 0)]
    with frame.bind():
        frame.clear(color=(0, 0, 0, 0))
        overlay.paint(window, "COLOR")
        pixels = frame.read_color(0, 0, 64, 48, 4, 0, "UBYTE")
    color = service().connection.image.color
    light = (color[..., :3] * color[..., 3:]) ** 2.2
    expected = 255 * np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light)
    found = np.array(pixels.to_list(), np.uint8).reshape(48, 64, 4)[::-1, :, :3]
    assert np.abs(found - expected).max() <= 1
    assert {each.identifier for each in scene.splatbus.bl_rna.properties["show"].enum_items} == {
        *importlib.import_module(f"{MODULE}.drawing").LOOKS
    }


def check_renders_show_splats():
    bpy.ops.splatbus.set_up_compositor()
    bpy.ops.render.render()


def check_a_render_without_a_server_says_so():
    bpy.ops.splatbus.disconnect()
    until(lambda: not ours())
    bpy.ops.render.render()  # whoever started this looks into the log


def check_disabled_it_leaves_nothing():
    bpy.ops.splatbus.connect()
    shows(2)
    turn = service()._turn
    bpy.ops.preferences.addon_disable(module=MODULE)
    assert not bpy.app.timers.is_registered(turn)
    end = time.monotonic() + 20
    while ours():
        assert time.monotonic() < end, ours()
        time.sleep(0.01)
    assert not hasattr(bpy.context.scene, "splatbus")
    bpy.context.scene.render.use_compositing = False
    bpy.ops.render.render()


def check_enabled_again_it_is_as_before():
    bpy.ops.preferences.addon_enable(module=MODULE)
    check_it_connects()
    bpy.context.scene.render.use_compositing = True
    bpy.ops.render.render()
    bpy.ops.preferences.addon_disable(module=MODULE)


bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True
)
for name, check in [*globals().items()]:
    if name.startswith("check_"):
        check()
        print(name, flush=True)
