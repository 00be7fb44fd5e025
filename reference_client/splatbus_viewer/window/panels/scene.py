"""The panel of the scene: its objects, the viewer's own ring, and its time."""

from __future__ import annotations

from imgui_bundle import imgui
from splatbus_client.lease import placement
from splatbus_schemas.visible import visible
from splatbus_wire.messages import DEFAULT_OBJECT, Placement, SceneObject
from splatbus_wire.poses import IDENTITY, Vector

from splatbus_viewer.window.choices import RING, Choices
from splatbus_viewer.window.gizmo import OPERATIONS
from splatbus_viewer.window.panels.look import Look


def panel(look: Look) -> None:
    """Describe it."""
    _objects(look)
    _time(look)


def placement_of(look: Look, name: str) -> Placement | None:
    """Where something that can be moved is now: as it was put, or as the image shows it."""
    if name == RING:
        return look.choices.ring
    if name in look.choices.objects:
        return look.choices.objects[name]
    return placement(look.own.get("objects", ()), name)


def middle_of(look: Look, name: str) -> Vector:
    """The middle of an object in its own axes, as far as the server has told its bounds."""
    objects = look.conversation.scene.objects if look.conversation.scene is not None else ()
    box = next((each.bounds for each in objects if each.id == name), None)
    if box is None:
        return (0.0, 0.0, 0.0)
    x, y, z = ((least + most) / 2 for least, most in zip(box.min, box.max))
    return x, y, z


def put(choices: Choices, where: Placement) -> None:
    """Put something where the gizmo has it."""
    if where.object == RING:
        choices.ring = where
    else:
        choices.objects[where.object] = where


def _objects(look: Look) -> None:
    choices = look.choices
    scene = look.conversation.scene
    objects = scene.objects if scene is not None else (SceneObject(DEFAULT_OBJECT, "splats", 0),)
    imgui.separator_text("move by handles")
    if imgui.radio_button("nothing", choices.held is None):
        choices.held = None
    for each in objects:
        told = f"{each.name}, {each.gaussians} Gaussians" if each.gaussians else each.name
        if imgui.radio_button(f"{visible(told)}##{each.id}", choices.held == each.id):
            choices.held = each.id
    if choices.ring is not None and imgui.radio_button(RING, choices.held == RING):
        choices.held = RING
    if choices.held is None:
        return
    for index, name in enumerate(OPERATIONS):
        if index:
            imgui.same_line()
        if imgui.radio_button(name, look.own.get("operation", "move") == name):
            look.own["operation"] = name
    if choices.held in choices.objects:
        imgui.same_line()
        if imgui.small_button("back"):
            put(choices, Placement(choices.held, IDENTITY))


def _time(look: Look) -> None:
    choices, scene = look.choices, look.conversation.scene
    if scene is None or scene.time_range is None:
        return
    imgui.separator_text("time in the scene")
    first, last = scene.time_range
    shown = look.own.get("image time", first) if choices.time is None else choices.time
    if imgui.button("pause" if choices.is_playing else "play"):
        choices.is_playing = not choices.is_playing
    imgui.same_line()
    imgui.set_next_item_width(-1)
    changed, set_to = imgui.slider_float("##time", shown, first, last, "%.2f s")
    if changed:
        choices.time = set_to
    if choices.is_playing and last > first:
        now = shown + look.seconds
        choices.time = first + (now - first) % (last - first)
