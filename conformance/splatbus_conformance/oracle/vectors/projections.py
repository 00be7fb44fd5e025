"""`projections.json`: from an engine's camera and a point before it to a place on the image."""

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

from splatbus_conformance.oracle.axes import ENGINES, Engine
from splatbus_conformance.oracle.deviation import U
from splatbus_conformance.oracle.intrinsics import Intrinsics
from splatbus_conformance.oracle.rotations import (
    Vector,
    apply,
    rotation_matrix,
    transpose,
)
from splatbus_conformance.oracle.rounding import Real, exact, to_single
from splatbus_conformance.oracle.vectors.conventions import (
    POSE_TOLERANCES,
    REQUIREMENTS,
    change_of_axes,
)
from splatbus_conformance.oracle.vectors.intrinsics import EXAMPLE, OFF_CENTRE, stated
from splatbus_conformance.oracle.vectors.layout import Json, both, pose, within
from splatbus_conformance.oracle.vectors.poses import HALF, IDENTITY, WORKED

_SAME = ENGINES["opengl_camera"].world
WIRE = Engine(_SAME, _SAME, 1)
ROWS = {"wire": WIRE, **ENGINES}

OBJECT_ROWS = {
    "wire": "wire",
    "unity": "unity",
    "unreal": "unreal",
    "blender_camera": "blender_object",
    "opengl": "opengl",
    "opengl_camera": "wire",
}
"""For each row of a camera, the row of an object in the same engine."""


class WirePose(NamedTuple):
    """On the wire."""

    position: tuple[float, ...]
    rotation: tuple[float, ...]


class ProjectedView(NamedTuple):
    """What a case is about, before it is put into an engine's axes."""

    camera: WirePose
    intrinsics: Intrinsics
    seen: list[tuple[float, float, float]]
    """Points in camera axes, roughly: they are rounded once they are in the engine's."""
    placed: WirePose | None = None
    """An object, in whose axes the points are then given."""
    size: float | None = None
    """The object's scale, where it is said."""


AROUND = [(0.0, 0.0, 4.0), (1.0, -0.75, 3.0), (-2.0, 1.5, 10.0), (30.0, 4.0, 5.0)]
BEHIND = [(0.25, 0.5, 4.0), (0.0, 0.0, -4.0), (1.0, 1.0, -0.125)]
OBJECT = WirePose((0.5, -0.25, 1.5), (0.18, -0.24, 0.4, 0.866))
VIEWS = {
    "at rest": ProjectedView(WirePose((0.0, 0.0, 0.0), IDENTITY), EXAMPLE, AROUND),
    "moved": ProjectedView(WirePose((1.0, -2.0, 5.0), IDENTITY), OFF_CENTRE, AROUND),
    "a quarter turn about y": ProjectedView(
        WirePose((1.0, 2.0, 3.0), (0.0, HALF, 0.0, HALF)), EXAMPLE, AROUND
    ),
    "the worked example of section 7.3": ProjectedView(
        WirePose((1.0, -2.0, 5.0), WORKED), OFF_CENTRE, AROUND
    ),
    "what is behind is nowhere": ProjectedView(WirePose((1.0, -2.0, 5.0), WORKED), EXAMPLE, BEHIND),
    "nearly a half turn": ProjectedView(
        WirePose((-3.5, 0.25, 8.0), (0.36, -0.48, 0.8, 1e-4)), OFF_CENTRE, AROUND
    ),
    "a kilometre away": ProjectedView(
        WirePose((707.106, -12.5, -707.107), WORKED), OFF_CENTRE, AROUND
    ),
    "a million units away": ProjectedView(WirePose((1e6, -1e6, 1e6), WORKED), OFF_CENTRE, AROUND),
    "an object, and the camera at rest": ProjectedView(
        WirePose((0.0, 0.0, 0.0), IDENTITY), EXAMPLE, AROUND, OBJECT
    ),
    "an object, and the camera turned": ProjectedView(
        WirePose((1.0, -2.0, 5.0), WORKED), OFF_CENTRE, AROUND, OBJECT
    ),
    "an object at a third of its size": ProjectedView(
        WirePose((1.0, -2.0, 5.0), WORKED), OFF_CENTRE, AROUND, OBJECT, to_single(Fraction(1, 3))
    ),
    "an object a thousand times its size": ProjectedView(
        WirePose((1.0, -2.0, 5.0), WORKED), EXAMPLE, AROUND, OBJECT, 1000.0
    ),
}


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "projections",
        "version": "1.1",
        "description": "From an engine's camera to places on an image. `camera` is a pose in the"
        " axes and units of the row `engine`; `points` are in the engine's world, or, where there"
        " is an `object`, in the object's own axes, of the row `object.engine`; its `scale` is 1 if"
        " absent; `intrinsics` are"
        " those of the frame. All these numbers are single-precision ones, but for the"
        " intrinsics. `expected` are the poses on the wire, and of each point its place in the"
        " world and in camera axes, both those of the wire, and its image point (u, v), null where"
        " the point is not in front of the camera (z ≤ 0). `engines` is as in conventions.json.",
        "requirements": [
            *("CNV-1", "CNV-2", "CNV-4", "CNV-5", "CNV-6", "CNV-7"),
            *("ACC-7", "IMG-1", "OBJ-5"),
        ],
        "tolerances": {
            **POSE_TOLERANCES,
            "world": within(
                "norm",
                32 * U,
                None,
                "What plain double precision reaches; no clause gives a budget.",
            ),
            "camera": within(
                "component",
                1e-8,
                None,
                "Scene units; set by cameras a million units away. Within a kilometre of the origin"
                " plain double precision stays below 1e-12.",
            ),
            "image_point": within(
                "component", 1e-6, None, "Pixels. Single precision does not reach it."
            ),
        },
        "engines": {name: change_of_axes(engine) for name, engine in ROWS.items()},
        "cases": [
            _case(f"{engine}, {name}", engine, view)
            for engine in OBJECT_ROWS
            for name, view in VIEWS.items()
        ],
    }


def _case(name: str, engine: str, view: ProjectedView) -> Json:
    row, object_row = ROWS[engine], ROWS[OBJECT_ROWS[engine]]
    camera = _in_engine(row, view.camera)
    placed = None if view.placed is None else _in_engine(object_row, view.placed)
    on_wire = _on_wire(row, camera)
    object_on_wire = None if placed is None else _on_wire(object_row, placed)
    size = Fraction(1 if view.size is None else view.size)
    points = [
        _point_in_engine(point, on_wire, row, object_on_wire, object_row, size)
        for point in view.seen
    ]
    return {
        "name": name,
        "requirement": REQUIREMENTS.get(engine, "CNV-1") if view.size is None else "OBJ-5",
        "engine": engine,
        "camera": pose(*camera),
        "object": placed and {"engine": OBJECT_ROWS[engine], **pose(*placed), **_size(view.size)},
        "intrinsics": stated(view.intrinsics),
        "points": [both(point) for point in points],
        "expected": {
            "camera": pose(*on_wire),
            "object": object_on_wire and pose(*object_on_wire),
            "points": [
                _seen(point, row, on_wire, object_row, object_on_wire, size, view.intrinsics)
                for point in points
            ],
        },
    }


Exactly = tuple[Vector, Vector]


def _size(size: float | None) -> Json:
    return {} if size is None else {"scale": both(size)}


def _in_engine(row: Engine, wire: WirePose) -> WirePose:
    """In single precision, so that every engine can hold it."""
    return WirePose(
        _singles(row.position_from_wire(wire.position)),
        _singles(row.quaternion_from_wire(wire.rotation)),
    )


def _singles(numbers: Sequence[Fraction]) -> tuple[float, ...]:
    return tuple(to_single(number) for number in numbers)


def _on_wire(row: Engine, engine: WirePose) -> Exactly:
    return row.position_to_wire(engine.position), row.quaternion_to_wire(engine.rotation)


def _place(pose_on_wire: Exactly, point: Sequence[Real]) -> Vector:
    position, rotation = pose_on_wire
    turned = apply(rotation_matrix(rotation), exact(point))
    return tuple(a + b for a, b in zip(turned, position, strict=True))


def _into(pose_on_wire: Exactly, point: Sequence[Fraction]) -> Vector:
    position, rotation = pose_on_wire
    offset = [a - b for a, b in zip(point, position, strict=True)]
    return apply(transpose(rotation_matrix(rotation)), offset)


def _point_in_engine(
    point: Sequence[float],
    camera: Exactly,
    row: Engine,
    placed: Exactly | None,
    object_row: Engine,
    size: Fraction,
) -> tuple[float, ...]:
    world = _place(camera, point)
    if placed is None:
        return _singles(row.position_from_wire(world))
    inside = tuple(a / size for a in _into(placed, world))
    return _singles(_own_from_wire(object_row, inside))


def _own_from_wire(row: Engine, point: Vector) -> Vector:
    """A point in an object's own axes: those change by D."""
    return tuple(row.scale * a for a in apply(row.camera, point))


def _own_to_wire(row: Engine, point: Vector) -> Vector:
    return tuple(a / row.scale for a in apply(transpose(row.camera), point))


def _seen(
    point: Sequence[float],
    row: Engine,
    camera: Exactly,
    object_row: Engine,
    placed: Exactly | None,
    size: Fraction,
    intrinsics: Intrinsics,
) -> Json:
    if placed is None:
        world = row.position_to_wire(point)
    else:
        world = _place(placed, [size * a for a in _own_to_wire(object_row, exact(point))])
    before = _into(camera, world)
    image_point = intrinsics.image_point(before)
    return {
        "world": both(world),
        "camera": both(before),
        "image_point": None if image_point is None else both(image_point),
    }
