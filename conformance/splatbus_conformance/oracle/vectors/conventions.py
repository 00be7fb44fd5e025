"""`conventions.json`: poses of the wire in each engine's axes, and back."""

from collections.abc import Sequence

from splatbus_conformance.oracle.axes import ENGINES, Engine
from splatbus_conformance.oracle.deviation import U
from splatbus_conformance.oracle.rotations import Rows
from splatbus_conformance.oracle.vectors.layout import Json, exactly, pose, within
from splatbus_conformance.oracle.vectors.poses import IDENTITY, WORKED

REQUIREMENTS = {
    "unity": "CNV-4",
    "unreal": "CNV-5",
    "blender_object": "CNV-6",
    "blender_camera": "CNV-6",
    "opengl": "CNV-7",
    "opengl_camera": "ACC-7",
}

POSES = {
    "identity": ((1.0, 2.0, 3.0), IDENTITY),
    "worked example": ((1.0, -2.0, 5.0), WORKED),
    "hundredths": ((0.07, -1.1, 2.29), (0.36, -0.48, 0.8, 1e-9)),
    "far, norm 1.009": ((12345.678, -0.001, 1e9), (-0.5045, 0.5045, 0.5045, 0.5045)),
}


POSE_TOLERANCES: Json = {
    "position": exactly("Correctly rounded where it is scaled; 0.0 and −0.0 are equal.", "ACC-7"),
    "rotation": within(
        "component",
        5 * U,
        "ACC-7",
        "4u, and 1u for the rounding of what is expected; q and −q are equal.",
        up_to_sign=True,
    ),
}
"""Of a pose in other axes."""


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "conventions",
        "version": "1.0",
        "description": "Poses before and after a change of axes, `from_wire` to the engine or"
        " `to_wire` from it. `engines` states each change on matrices: p' = scale·world·p and"
        " R' = world·R·cameraᵀ, both lists of rows.",
        "requirements": ["CNV-3", "CNV-4", "CNV-5", "CNV-6", "CNV-7", "ACC-7"],
        "tolerances": POSE_TOLERANCES,
        "engines": {
            name: {"requirement": REQUIREMENTS[name], **change_of_axes(engine)}
            for name, engine in ENGINES.items()
        },
        "cases": [
            _case(engine, direction, name)
            for engine in ENGINES
            for direction in ("from_wire", "to_wire")
            for name in POSES
        ],
    }


def change_of_axes(engine: Engine) -> Json:
    """Return the row of an engine as members of `engines`."""
    return {
        "world": _integers(engine.world),
        "camera": _integers(engine.camera),
        "scale": engine.scale,
    }


def _integers(rows: Rows) -> list[list[int]]:
    return [[int(entry) for entry in row] for row in rows]


def _case(engine: str, direction: str, name: str) -> Json:
    position, rotation = POSES[name]
    axes = ENGINES[engine]
    there: Sequence[Json] = (
        (axes.position_from_wire(position), axes.quaternion_from_wire(rotation))
        if direction == "from_wire"
        else (axes.position_to_wire(position), axes.quaternion_to_wire(rotation))
    )
    return {
        "name": f"{engine}, {direction}, {name}",
        "requirement": REQUIREMENTS[engine],
        "engine": engine,
        "direction": direction,
        "pose": pose(position, rotation),
        "expected": pose(*there),
    }
