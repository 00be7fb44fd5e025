"""The panel of the view: whom it is connected to, what is shown, how the camera moves."""

from __future__ import annotations

from imgui_bundle import imgui
from splatbus_client.channel import ChannelStatus
from splatbus_schemas.visible import visible

from splatbus_viewer.display import RAMP
from splatbus_viewer.window import MODES, cameras, hands
from splatbus_viewer.window.choices import ASSUMED_FIELD, RING, ring_before
from splatbus_viewer.window.panels.look import Look

_GOOD, _BAD = imgui.ImVec4(0.45, 0.80, 0.45, 1), imgui.ImVec4(0.95, 0.60, 0.35, 1)


def panel(look: Look) -> None:
    """Describe it."""
    _connection(look)
    imgui.separator_text("shown")
    _mode(look)
    imgui.separator_text("camera")
    _camera(look)
    if imgui.button("screenshot (P)"):
        look.screenshot()
    if look.saved is not None:
        imgui.same_line()
        imgui.text_disabled(look.saved)
    if imgui.collapsing_header("keys and mouse"):
        for what, does in hands.HELP:
            imgui.text_disabled(what)
            imgui.same_line(190.0)
            imgui.text_wrapped(does)


def _connection(look: Look) -> None:
    status = look.session.status
    server = status.ipc.server or status.message.server
    if server is not None:
        imgui.text_wrapped(visible(f"{server.name} {server.version}"))
    for name, channel in (("images", status.ipc), ("messages", status.message)):
        imgui.text_colored(_GOOD if channel.connected else _BAD, f"{name}: {_state(channel)}")
    for sentence in (status.no_images, status.no_effect, *look.conversation.problems):
        if sentence is not None:
            imgui.push_style_color(imgui.Col_.text, _BAD)
            imgui.text_wrapped(sentence)
            imgui.pop_style_color()


def _state(channel: ChannelStatus) -> str:
    if not channel.connected:
        return channel.problem or "connecting"
    return f"SplatBus {channel.version}" if channel.version else "connected"


def _mode(look: Look) -> None:
    choices = look.choices
    for index, mode in enumerate(MODES):
        if index % 2:
            imgui.same_line(110.0)
        if imgui.radio_button(
            f"{'colour' if mode == 'color' else mode} ({index + 1})", choices.mode == mode
        ):
            choices.mode = mode
    if choices.mode == "depth":
        _legend()
        _, choices.is_fitting = imgui.checkbox("colours span what is seen", choices.is_fitting)
        changed, (near, far) = imgui.drag_float2("near, far", list(choices.depths), 0.01)
        if changed and far > near:
            choices.depths, choices.is_fitting = (near, far), False
    if choices.mode == "composite":
        has_grid = choices.grid is not None
        changed, has_grid = imgui.checkbox("grid", has_grid)
        if changed:
            choices.grid = 1.0 if has_grid else None
        if choices.grid is not None:
            imgui.same_line(110.0)
            imgui.set_next_item_width(-1)
            _, choices.grid = imgui.drag_float("##height", choices.grid, 0.02, format="at y = %.2f")
        changed, has_ring = imgui.checkbox("ring, to be moved", choices.ring is not None)
        if changed:
            choices.ring = ring_before(choices.eye) if has_ring else None
            choices.held = RING if has_ring else None


def _legend() -> None:
    """A bar of the false colours, near to far."""
    width, height = imgui.get_content_region_avail().x, imgui.get_text_line_height()
    corner, draw = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    tints = [imgui.get_color_u32(imgui.ImVec4(r / 255, g / 255, b / 255, 1)) for r, g, b in RAMP]
    step = width / (len(RAMP) - 1)
    for index, (left, right) in enumerate(zip(tints, tints[1:])):
        begin = imgui.ImVec2(corner.x + index * step, corner.y)
        end = imgui.ImVec2(corner.x + (index + 1) * step, corner.y + height)
        draw.add_rect_filled_multi_color(begin, end, left, right, right, left)
    imgui.dummy(imgui.ImVec2(width, height))


def _camera(look: Look) -> None:
    choices, camera = look.choices, look.camera
    for index, kind in enumerate(cameras.KINDS):
        if index:
            imgui.same_line()
        if imgui.radio_button(kind, choices.kind == kind):
            choices.kind = kind
    x, y, z = (round(each, 3) + 0.0 for each in choices.eye.pose.position)  # no -0.000
    imgui.text(f"at {x:.3f}, {y:.3f}, {z:.3f}")
    label = "to its pivot %.3g" if choices.kind == "orbit" else "%.3g units a second"
    _, distance = imgui.drag_float(
        "##distance", choices.eye.distance, 0.02, cameras.NEAREST, 1e6, label
    )
    choices.eye = choices.eye._replace(distance=max(distance, cameras.NEAREST))
    capabilities = look.session.status.message.capabilities
    if "intrinsics" in capabilities and camera is not None:
        asked = choices.field_of_view is not None
        changed, asked = imgui.checkbox("field of view", asked)
        if changed:
            choices.field_of_view = ASSUMED_FIELD if asked else None
            choices.is_steering = True
        if choices.field_of_view is not None:
            imgui.same_line()
            imgui.set_next_item_width(-1)
            _, choices.field_of_view = imgui.slider_float(
                "##degrees", choices.field_of_view, 5.0, 150.0, "%.0f degrees high"
            )
    scene = look.conversation.scene
    if scene is None or scene.cameras:
        index = look.own.setdefault("camera index", 0)
        imgui.set_next_item_width(110.0)
        entered, index = imgui.input_int("camera of the scene", index)
        if scene is not None:
            index %= scene.cameras
        if entered or imgui.is_item_deactivated_after_edit():
            look.conversation.jump(index)
        look.own["camera index"] = index
