"""The panel of packets: what went over both channels, newest last, each with its bytes."""

from __future__ import annotations

from imgui_bundle import imgui

from splatbus_viewer.window.packets import Packet
from splatbus_viewer.window.panels.look import Look
from splatbus_viewer.window.screen import monospaced

_TINTS = {"sent": imgui.ImVec4(0.60, 0.78, 1.0, 1), "received": imgui.ImVec4(0.80, 0.85, 0.70, 1)}
_STREAMS = ("frame", "release", "camera_pose", "telemetry", "pong", "ping")
"""What goes on and on."""


def panel(look: Look) -> None:
    """Describe it: a list with a filter, and the packet that was chosen in it."""
    packets, own = look.packets, look.own
    _, packets.is_paused = imgui.checkbox("pause", packets.is_paused)
    imgui.same_line()
    _, own["quiet"] = imgui.checkbox("without streams", own.setdefault("quiet", True))
    imgui.same_line()
    imgui.set_next_item_width(220.0)
    _, own["filter"] = imgui.input_text_with_hint(
        "##filter", "only with this text", own.setdefault("filter", "")
    )
    imgui.same_line()
    if imgui.button("clear"):
        packets.clear()
        own.pop("packet", None)
    rows = [each for each in packets.newest.copy() if _is_wanted(each, own["filter"], own["quiet"])]
    imgui.same_line()
    imgui.text_disabled(f"{len(rows)} of {len(packets.newest)} packets")
    chosen: Packet | None = own.get("packet")
    width = imgui.get_content_region_avail().x
    imgui.push_font(monospaced(), 0.0)
    imgui.begin_child("##list", imgui.ImVec2(0.55 * width if chosen else 0.0, 0.0))
    _list(look, rows, chosen)
    imgui.end_child()
    if chosen is not None:
        imgui.same_line()
        imgui.begin_child("##packet", imgui.ImVec2(0.0, 0.0))
        _packet(chosen)
        imgui.end_child()
    imgui.pop_font()


def _list(look: Look, rows: list[Packet], chosen: Packet | None) -> None:
    follows = imgui.get_scroll_y() >= imgui.get_scroll_max_y()
    clipper = imgui.ListClipper()
    clipper.begin(len(rows))
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            each = rows[index]
            imgui.push_style_color(imgui.Col_.text, _TINTS[each.way])
            arrow = "->" if each.way == "sent" else "<-"
            ago = each.time - look.now
            label = f"{ago:8.2f} s {arrow} {each.channel:7} {each.size:6} B  {each.summary}"
            clicked, _ = imgui.selectable(f"{label}##{index}", each is chosen)
            imgui.pop_style_color()
            if clicked:
                look.own["packet"] = None if each is chosen else each
    if follows:
        imgui.set_scroll_here_y(1.0)


def _packet(packet: Packet) -> None:
    for name, text in (("JSON", packet.text), ("bytes", packet.dump)):
        imgui.separator_text(name)
        if imgui.small_button(f"copy##{name}"):
            imgui.set_clipboard_text(text)
        imgui.text_unformatted(text)


def _is_wanted(packet: Packet, text: str, quiet: bool) -> bool:
    if quiet and any(f'"{name}"'.encode() in packet.payload[:200] for name in _STREAMS):
        return False
    return not text or text.encode() in packet.payload
