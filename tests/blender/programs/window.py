"""The extension's drawing, panels and timer in the window of a Blender that is older than it wants.

    blender --python-use-system-env --python window.py -- FOLDER LOOK…

Blender 3.4, of Debian, has a window where there is a virtual display; the wheels of later ones have
none. What needs later nodes is left out: this is an add-on of the old style around all else. Writes
screenshots.
"""

import os
import sys
import time
import traceback
from pathlib import Path

import bpy
import gpu
from scenery import EYE, MIDDLE, in_the_garden, looking
from splatbus_blender import operators, overlay, panels, properties, service
from splatbus_blender.core.wanted import said, shows

bl_info = {"name": "SplatBus", "blender": (3, 4, 0), "category": "3D View"}
PLACE, *LOOKS = sys.argv[sys.argv.index("--") + 1 :]
LIMIT_SECONDS = 200
_PARTS = (properties, operators, panels, overlay)


def register():
    # No operator opens a page of the sidebar: ours is open where there is no other.
    for each in (getattr(bpy.types, name) for name in dir(bpy.types)):
        place = getattr(each, "bl_space_type", ""), getattr(each, "bl_region_type", "")
        if place == ("VIEW_3D", "UI") and each.__module__.startswith("bl_ui."):
            bpy.utils.unregister_class(each)
    for each in _PARTS:
        each.register()


def unregister():
    service.unregister()
    for each in reversed(_PARTS):
        each.unregister()


def stage():
    in_the_garden()
    _, space = service.viewport()
    space.shading.light, space.shading.color_type = "STUDIO", "SINGLE"
    space.shading.single_color = (0.9, 0.55, 0.2)
    space.clip_start = 1
    space.overlay.show_overlays = space.show_gizmo = space.show_region_toolbar = False
    space.show_region_ui = True
    view = space.region_3d
    view.view_perspective = "PERSP"
    view.view_location, view.view_distance = MIDDLE, (MIDDLE - EYE).length
    view.view_rotation = looking()


def is_shown():
    """Whether the newest image is that of the view as it is now."""
    connection = service.connection
    image, session = connection.image, connection.session
    wanted, _ = service._wanted()
    if image is None or image.camera is None or (wanted.depth and image.depth is None):
        return False
    if (image.camera.width, image.camera.height) != wanted.size:
        return False
    able = session.status.message.capabilities
    return shows(image.camera, image.objects, said(wanted, session.images), able)


def screenshot(name):
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, screen=window.screen):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=2)
        bpy.ops.screen.screenshot(filepath=str(Path(PLACE, f"{name}.png")))


def work():
    """Yields what has to hold before it goes on."""
    register()
    stage()
    yield lambda: True
    bpy.ops.splatbus.connect()
    for look in LOOKS:
        bpy.context.scene.splatbus.show = look
        # The sky is far behind all else.
        service.viewport()[1].clip_end = 9 if look == "DEPTH" else 100
        yield is_shown
        screenshot(look)
    unregister()
    print(gpu.platform.renderer_get(), flush=True)
    bpy.ops.wm.quit_blender()


steps, holds, end = work(), None, 0.0


def turn():
    global holds, end
    try:
        if holds is None or holds():
            holds, end = next(steps), time.monotonic() + LIMIT_SECONDS
        assert time.monotonic() < end, service.complaints()
    except StopIteration:
        return None
    except BaseException:
        traceback.print_exc()
        os._exit(1)  # else the window stays
    return 0.05


bpy.context.preferences.view.show_splash = False
bpy.context.preferences.system.viewport_aa = "OFF"
bpy.app.timers.register(turn, first_interval=0.5)
