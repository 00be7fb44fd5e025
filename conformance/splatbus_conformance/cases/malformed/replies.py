"""Replies of 1.1 and telemetry whose members are missing, of another type, or cannot be so."""

from splatbus_conformance.wire.messages import Json, intrinsics

HUGE = 10**400
_OBJECT: Json = {"id": "default", "name": "Garden", "gaussians": 7, "bounds": None}
_SCENE: Json = {"objects": [_OBJECT], "timeRange": None, "cameras": 3, "origin": [0, 0, 0]}
_CAMERA: Json = {"position": [0, 0, 0], "rotation": [0, 0, 0, 1]}


def _objects(**changes: object) -> Json:
    return {**_SCENE, "objects": [{**_OBJECT, **changes}]}


def _lens(**changes: object) -> Json:
    return {**_CAMERA, "intrinsics": {**intrinsics(), **changes}}


BAD_REPLIES: dict[str, tuple[Json, ...]] = {
    "camera": (
        {**_CAMERA, "intrinsics": None},
        {**_CAMERA, "intrinsics": [64, 64, 32, 24]},
        _lens(fx=0),
        _lens(width=0, height=0),
        _lens(far=0.001),
        _lens(cx=1e308),
    ),
    "viewport_size": (
        {},
        {"viewport_size": [0, 0]},
        {"viewport_size": [2**31, 2**31]},
        {"viewport_size": [-1, -1]},
        {"viewport_size": None},
    ),
    "scene": (
        {},
        {**_SCENE, "objects": None},
        {**_SCENE, "objects": {"default": _OBJECT}},
        {**_SCENE, "objects": [None, [], 7]},
        {**_SCENE, "objects": [_OBJECT, _OBJECT]},
        {**_SCENE, "objects": [_OBJECT] * 10_000},
        _objects(id=7),
        _objects(id=""),
        _objects(id="i" * 100_000),
        _objects(name=None),
        _objects(gaussians=-1),
        _objects(gaussians=HUGE),
        _objects(gaussians=0.5),
        _objects(bounds=[]),
        _objects(bounds={"min": [0, 0, 0]}),
        _objects(bounds={"min": [1, 1, 1], "max": [0, 0, 0]}),
        _objects(bounds={"min": [None] * 3, "max": "abc"}),
        {**_SCENE, "timeRange": []},
        {**_SCENE, "timeRange": [1, 0]},
        {**_SCENE, "timeRange": ["0", None]},
        {**_SCENE, "cameras": 2.5},
        {**_SCENE, "cameras": HUGE},
        {**_SCENE, "origin": None},
        {**_SCENE, "origin": [0, 0]},
    ),
    "pong": (
        {},
        {"t": 12.5},
        {"serverTime": 12.5},
        {"t": None, "serverTime": None},
        {"t": "12.5", "serverTime": []},
        {"t": -1e308, "serverTime": 1e308},
        {"t": HUGE, "serverTime": -HUGE},
    ),
}
"""Of each type of reply, without `type` and `id`."""

BAD_TELEMETRY: tuple[Json, ...] = (
    {"series": None},
    {"series": []},
    {"series": [None, 7, "scalar", []]},
    {"series": [{}]},
    {"series": [{"name": "n", "kind": "scalar"}]},
    {"series": [{"name": "n", "kind": ["scalar"], "value": 1}]},
    {"series": [{"name": None, "kind": "scalar", "value": 1}]},
    {"series": [{"name": "n", "kind": "scalar", "value": "fast"}]},
    {"series": [{"name": "n", "kind": "scalar", "value": HUGE, "unit": 7}]},
    {"series": [{"name": "n", "kind": "histogram"}]},
    {"series": [{"name": "n", "kind": "histogram", "edges": [], "counts": []}]},
    {"series": [{"name": "n", "kind": "histogram", "edges": [0, 1], "counts": []}]},
    {"series": [{"name": "n", "kind": "histogram", "edges": [1, 1, 0], "counts": [1, 2]}]},
    {"series": [{"name": "n", "kind": "histogram", "edges": [0, 1], "counts": [-1]}]},
    {"series": [{"name": "n", "kind": "histogram", "edges": "01", "counts": {"0": 1}}]},
    {"series": [{"name": "n", "kind": "text", "value": None}]},
    {"series": [{"name": "n", "kind": "text", "value": "v" * 100_000}]},
    {"series": [{"name": "n", "kind": "text", "value": "\ud800"}]},
    {"series": [{"name": "n", "kind": "text", "value": "twice"}] * 2},
    {"seq": -1, "series": [{"name": "n", "kind": "text", "value": ""}]},
    {"time": None, "series": [{"name": "n", "kind": "text", "value": ""}]},
)
"""Without `type`; `seq` and `time` where they are not the fault."""
