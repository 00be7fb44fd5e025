"""What a server sends, parsed: each function takes one message's fields."""

from __future__ import annotations

from splatbus_schemas import LIMITS

from splatbus_wire.fields import MAX_SAFE_INTEGER, Field, array_pose
from splatbus_wire.message_types import (
    DEFAULT_OBJECT,
    Box,
    CameraReply,
    ErrorMessage,
    Frame,
    FrameCamera,
    Histogram,
    Placement,
    Pong,
    Scalar,
    Scene,
    SceneObject,
    Series,
    Telemetry,
    Text,
    ViewportSize,
    Welcome,
)
from splatbus_wire.parts import (
    MAX_IMAGE_SIZE,
    MAX_NAME_CHARS,
    capabilities,
    different,
    intrinsics,
    program,
    version,
)


def welcome(message: Field) -> Welcome:
    """What the connection has from now on [NEG-30]."""
    fields = message.under("NEG-30")
    return Welcome(
        version(fields.member("version")),
        program(fields.member("server")),
        capabilities(fields.member("capabilities")),
    )


def error(fields: Field) -> ErrorMessage:
    """What was wrong [NEG-23]."""
    # Any code and any pointer is taken: an error that breaks a rule still says something [NEG-24].
    pointer = fields.optional("pointer")
    supported = fields.under("NEG-10").optional("supported")
    return ErrorMessage(
        fields.member("code").string(1, LIMITS["max_message_chars"]),
        fields.member("message").string(0, LIMITS["max_message_chars"]),
        fields.id(),
        None if pointer is None else pointer.string(0, MAX_SAFE_INTEGER),
        None if supported is None else tuple(map(version, supported.items(1))),
    )


def frame(fields: Field) -> Frame:
    """A slot that is lent, and what is in it [IMG-1]."""
    return Frame(
        fields.generation(),
        fields.seq(),
        fields.member("slot").integer(0, LIMITS["max_slots"] - 1),
        _frame_camera(fields.member("camera")),
        fields.member("time").number(),
        fields.member("renderedAt").number(),
        _placements(fields.optional("objects")),
    )


def viewport_size(message: Field) -> ViewportSize:
    """The size of the images [REQ-3]."""
    size = message.under("REQ-3").member("viewport_size")
    width, height = (item.integer(0, MAX_IMAGE_SIZE) for item in size.items(2, 2))
    return ViewportSize(width, height, _reply_id(message))


def camera(message: Field) -> CameraReply:
    """A camera that the scene comes with [REQ-5, CAM-8]."""
    # Without `type` it is a reply of 1.0, which knows no `intrinsics` either [JSN-7].
    lens = message.under("CAM-8").optional("intrinsics") if "type" in message.value else None
    return CameraReply(
        array_pose(message.under("REQ-5")),
        _reply_id(message),
        None if lens is None else intrinsics(lens.under("CAM-4")),
    )


def scene(message: Field) -> Scene:
    """What the scene consists of [SCN-2]."""
    fields = message.under("SCN-2")
    array, time_range = fields.member("objects"), fields.member("timeRange")
    objects = [_scene_object(item) for item in array.items(1, LIMITS["max_objects"])]
    if DEFAULT_OBJECT not in different(array, [each.id for each in objects]):
        raise array.refused(f"has none with the id {DEFAULT_OBJECT}")
    return Scene(
        tuple(objects),
        None if time_range.value is None else _time_range(time_range),
        fields.member("cameras").integer(0, MAX_SAFE_INTEGER),
        fields.member("origin").vector(),
        _reply_id(message),
    )


def pong(message: Field) -> Pong:
    """The server's clock [PNG-2]."""
    fields = message.under("PNG-2")
    return Pong(
        fields.member("t").number(), fields.member("serverTime").number(), _reply_id(message)
    )


def telemetry(message: Field) -> Telemetry:
    """Figures from the renderer [TEL-2]; a series of an unknown kind is left out [TEL-6]."""
    fields = message.under("TEL-2")
    array = fields.member("series")
    listed = array.items(1, LIMITS["max_series"])
    different(array, [item.member("name").string(1, MAX_NAME_CHARS) for item in listed])
    series = [one_series(item) for item in listed]
    return Telemetry(
        fields.seq(),
        fields.member("time").number(),
        tuple(each for each in series if each is not None),
    )


def _frame_camera(camera: Field) -> FrameCamera:
    near, far = camera.member("near").positive(), camera.member("far").positive()
    if not near < far:
        raise camera.member("far").refused(f"is {far}, not greater than near, {near}")
    tag = camera.optional("tag")
    return FrameCamera(
        array_pose(camera),
        camera.member("fx").positive(),
        camera.member("fy").positive(),
        camera.member("cx").number(),
        camera.member("cy").number(),
        camera.member("width").integer(1, MAX_IMAGE_SIZE),
        camera.member("height").integer(1, MAX_IMAGE_SIZE),
        near,
        far,
        None if tag is None else tag.under("CAM-3").string(1, LIMITS["max_tag_chars"]),
    )


def _placements(objects: Field | None) -> tuple[Placement, ...]:
    if objects is None:
        return ()
    listed = objects.under("OBJ-7")
    placements = [
        Placement(
            item.member("object").string(1, MAX_NAME_CHARS),
            array_pose(item),
            item.member("scale").positive(),
        )
        for item in listed.items(0, LIMITS["max_objects"])
    ]
    different(listed, [placement.object for placement in placements])
    return tuple(placements)


def _scene_object(item: Field) -> SceneObject:
    bounds = item.member("bounds")
    return SceneObject(
        item.member("id").string(1, MAX_NAME_CHARS),
        item.member("name").string(0, MAX_NAME_CHARS),
        item.member("gaussians").integer(0, MAX_SAFE_INTEGER),
        None if bounds.value is None else _box(bounds),
    )


def _box(bounds: Field) -> Box:
    box = Box(bounds.member("min").vector(), bounds.member("max").vector())
    if any(least > most for least, most in zip(*box)):
        raise bounds.refused("has a min that is greater than its max")
    return box


def _time_range(array: Field) -> tuple[float, float]:
    first, last = (item.number() for item in array.items(2, 2))
    if first > last:
        raise array.refused(f"begins at {first}, after its end, {last}")
    return first, last


def one_series(item: Field) -> Series | None:
    """One of what a renderer tells; None if its kind is unknown [TEL-6]."""
    name = item.member("name").string(1, MAX_NAME_CHARS)
    kind = item.member("kind").string(0, MAX_SAFE_INTEGER)
    if kind == "scalar":
        unit = item.optional("unit")
        return Scalar(
            name,
            item.member("value").number(),
            None if unit is None else unit.string(0, MAX_NAME_CHARS),
        )
    if kind == "histogram":
        return _histogram(name, item)
    if kind == "text":
        return Text(name, item.member("value").string(0, LIMITS["max_text_chars"]))
    return None


def _histogram(name: str, item: Field) -> Histogram:
    array = item.member("edges")
    edges = tuple(edge.number() for edge in array.items(2, LIMITS["max_edges"]))
    if any(not a < b for a, b in zip(edges, edges[1:])):
        raise array.refused("does not ascend")
    counts = item.member("counts").items(len(edges) - 1, len(edges) - 1)
    return Histogram(name, edges, tuple(count.integer(0, MAX_SAFE_INTEGER) for count in counts))


def _reply_id(message: Field) -> int | None:
    # Without `type` it is a reply of 1.0, which knows no `id` [JSN-7].
    return message.under("NEG-28").id() if "type" in message.value else None
