"""Where the panels are, and what part of the window is the image's."""

from __future__ import annotations

from collections.abc import Callable

from imgui_bundle import imgui

from splatbus_viewer.window.gizmo import dragged
from splatbus_viewer.window.panels import figures, log, scene, view
from splatbus_viewer.window.panels.look import Look

Area = tuple[float, float, float, float]
"""Left, top, width, height in the units of the desktop."""
_SIDE, _BELOW = 0.24, 0.25
_PANELS = {"View": view.panel, "Scene": scene.panel, "Figures": figures.panel, "Packets": log.panel}
_DARK = 0x99000000
"""Over an image whose server has gone: alpha, blue, green, red."""
_SETTLED = 3
"""Images after which the panels are where they were laid."""
_BESIDE, _UNDER = ("View", "Scene"), ("Figures", "Packets")


def describe(look: Look) -> Area:
    """Describe the interface of one image, and return what part of the window it leaves free."""
    if not look.choices.shows_panels:
        area = _whole()
    else:
        area = _docked()
        look.own["visible"] = {name for name, panel in _PANELS.items() if _shown(name, panel, look)}
    if look.trouble is not None:
        _notice(look.trouble, area)
    return area


def hold(look: Look, area: Area) -> None:
    """Draw the handles of what the gizmo holds over the image, and take where it is put."""
    choices, camera = look.choices, look.camera
    if camera is None or choices.held is None or not choices.shows_panels:
        return
    placement = scene.placement_of(look, choices.held)
    operation = look.own.setdefault("operation", "move")
    if placement is None:
        return
    middle = scene.middle_of(look, choices.held)
    if put := dragged(placement, middle, camera, operation, area):
        scene.put(choices, put)


def _docked() -> Area:
    identity = imgui.dock_space_over_viewport(
        flags=imgui.DockNodeFlags_.passthru_central_node
        | imgui.DockNodeFlags_.no_docking_over_central_node
    )
    node = imgui.internal.dock_builder_get_node(identity)
    if node is None or node.is_leaf_node():
        _lay_out(identity)
    elif imgui.get_frame_count() == _SETTLED:
        imgui.set_window_focus(_UNDER[0])  # of tabs the last one is in front at first
    central = imgui.internal.dock_builder_get_central_node(identity)
    if central is None:
        return _whole()
    return central.pos.x, central.pos.y, central.size.x, central.size.y


def _lay_out(identity: int) -> None:
    builder = imgui.internal
    builder.dock_builder_set_node_size(identity, imgui.get_main_viewport().size)
    below = builder.dock_builder_split_node(identity, imgui.Dir.down, _BELOW)
    side = builder.dock_builder_split_node(below.id_at_opposite_dir, imgui.Dir.left, _SIDE)
    sides = builder.dock_builder_split_node(side.id_at_dir, imgui.Dir.up, 0.69)
    for name, place in zip(_BESIDE, (sides.id_at_dir, sides.id_at_opposite_dir)):
        builder.dock_builder_dock_window(name, place)
    for name in _UNDER:
        builder.dock_builder_dock_window(name, below.id_at_dir)
    builder.dock_builder_finish(identity)


def _shown(name: str, panel: Callable[[Look], None], look: Look) -> bool:
    visible, _ = imgui.begin(name)
    if visible:
        panel(look)
    imgui.end()
    return bool(visible) and imgui.get_frame_count() > _SETTLED


def _whole() -> Area:
    viewport = imgui.get_main_viewport()
    return viewport.pos.x, viewport.pos.y, viewport.size.x, viewport.size.y


def _notice(text: str, area: Area) -> None:
    left, top, width, height = area
    flags = imgui.WindowFlags_
    middle = imgui.ImVec2(left + width / 2, top + height / 2)
    corners = imgui.ImVec2(left, top), imgui.ImVec2(left + width, top + height)
    imgui.get_background_draw_list().add_rect_filled(*corners, _DARK)
    imgui.set_next_window_pos(middle, imgui.Cond_.always, imgui.ImVec2(0.5, 0.5))
    imgui.set_next_window_size(imgui.ImVec2(min(520.0, 0.9 * width), 0.0))
    imgui.begin(
        "##notice", flags=flags.no_decoration | flags.no_docking | flags.no_move | flags.no_inputs
    )
    imgui.text_wrapped(text)
    imgui.end()
