"""The stress sets of poses: what is taken, how exactly, and what is refused, and why.

Each set goes the whole way, from the text of a message to the matrices; the errors are against
exact rational arithmetic, in units of the budgets (u = 2⁻⁵³). A set's worst case is looked for by
random draws, then by climbing: small changes of the worst pose found so far.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import decode_from_client
from splatbus_wire.poses import Pose, camera_centre, view_matrix, world_matrix

Numbers = tuple[float, ...]
Draw = Callable[[random.Random], tuple[Numbers, Numbers]]


def unit(source: random.Random, norm: float = 1.0) -> Numbers:
    q = [source.gauss(0, 1) for _ in range(4)]
    length = math.hypot(*q) / norm
    return tuple(a / length for a in q)


def position(source: random.Random, size: float = 10.0) -> Numbers:
    return tuple(source.uniform(-size, size) for _ in range(3))


def half_turn(source: random.Random) -> Numbers:
    x, y, z, _ = unit(source)
    w = source.choice((0.0, -0.0, 1e-16, 1e-8, 1e-3)) * source.uniform(-1, 1)
    length = math.hypot(x, y, z, w)
    return x / length, y / length, z / length, w / length


def near_identity(source: random.Random) -> Numbers:
    small = 10.0 ** source.uniform(-20, -3)
    return *(small * a for a in unit(source)[:3]), 1.0


def to_single(values: Numbers) -> Numbers:
    return tuple(float(np.float32(a)) for a in values)


TAKEN: dict[str, Draw] = {
    "any rotation, norm 1": lambda r: (position(r), unit(r)),
    "norm 0.9901 to 1.0099": lambda r: (position(r), unit(r, r.uniform(0.9901, 1.0099))),
    "half-turns, w ≈ 0": lambda r: (position(r), half_turn(r)),
    "near the identity": lambda r: (position(r), near_identity(r)),
    "float32 numbers": lambda r: (to_single(position(r)), to_single(unit(r))),
    "position zero, −0.0, subnormal": lambda r: (
        tuple(r.choice((0.0, -0.0, 5e-324, -2.2e-308)) for _ in range(3)),
        unit(r),
    ),
    "|position| 1e-3": lambda r: (position(r, 1e-3), unit(r)),
    "|position| 1e9": lambda r: (position(r, 1e9), unit(r)),
}


def text(at: Numbers, q: Numbers) -> str:
    return json.dumps(
        {
            "type": "camera_pose",
            "position": dict(zip("xyz", at, strict=True)),
            "rotation": dict(zip("xyzw", q, strict=True)),
        }
    )


def received(payload: str) -> Pose:
    message: Any = decode_from_client(payload.encode(), "msg", said_hello=True)
    pose: Pose = message.pose
    return pose


def errors(at: Numbers, q: Numbers) -> dict[str, float]:
    """In u: an entry of R, RᵀR − I, −Rᵀ·c and the centre that comes back."""
    pose = received(text(at, q))
    view = view_matrix(pose)
    world = world_matrix(pose)
    R = tuple(world[i : i + 3] for i in (0, 4, 8))
    return {
        "R": oracle.error_in_u([a for row in R for a in row], sum(oracle.rotation_matrix(q), ())),
        "RtR": oracle.orthogonality_error(R) / float(oracle.U),
        "t": oracle.norm_error(view[3:12:4], oracle.view_translation(at, q)) / float(oracle.U),
        "centre": oracle.norm_error(camera_centre(view), oracle.exact(at)) / float(oracle.U),
    }


def worst(draw: Draw, draws: int, climbs: int, seed: int = 1) -> dict[str, Any]:
    """The worst error of each kind in a set, and the pose that gives it."""
    source = random.Random(seed)
    found: dict[str, Any] = {}
    cases = [draw(source) for _ in range(draws)]
    measured = [(errors(*case), case) for case in cases]
    for kind in measured[0][0]:
        value, case = max(((e[kind], c) for e, c in measured), key=lambda pair: pair[0])
        for _ in range(climbs):
            at, q = case
            step = 10.0 ** source.uniform(-16, -1)
            near = (
                tuple(a * (1 + step * source.gauss(0, 1)) for a in at),
                tuple(a + step * source.gauss(0, 1) * abs(a) for a in q),
            )
            if abs(math.hypot(*near[1]) - math.hypot(*q)) > 1e-3:
                continue
            if not 0.99 <= math.hypot(*near[1]) <= 1.01:
                continue
            climbed = errors(*near)[kind]
            if climbed > value:
                value, case = climbed, near
        found[kind] = {"u": round(value, 2), "position": case[0], "rotation": case[1]}
    return found


_AT = '"position":{"x":0,"y":0,"z":0}'
_Q = '"rotation":{"x":0,"y":0,"z":0,"w":1}'
DECIDED = {
    "rotation of norm 0": f'{_AT},"rotation":{{"x":0,"y":0,"z":0,"w":0}}',
    "rotation of norm 1e160": f'{_AT},"rotation":{{"x":1e160,"y":0,"z":0,"w":0}}',
    "rotation of norm 1e-160": f'{_AT},"rotation":{{"x":1e-160,"y":0,"z":0,"w":0}}',
    "rotation of norm 1.0101": f'{_AT},"rotation":{{"x":0,"y":0,"z":0,"w":1.0101}}',
    "a NaN in the rotation": f'{_AT},"rotation":{{"x":NaN,"y":0,"z":0,"w":1}}',
    "infinity in the position": f'"position":{{"x":Infinity,"y":0,"z":0}},{_Q}',
    "1e400 in the position": f'"position":{{"x":1e400,"y":0,"z":0}},{_Q}',
    "integers for numbers": f"{_AT},{_Q}",
    "a subnormal position": f'"position":{{"x":5e-324,"y":-0.0,"z":0}},{_Q}',
    "a float32 printed with 9 digits": f'"position":{{"x":0.100000001,"y":0,"z":0}},{_Q}',
    "a float64 printed with 17 digits": f'"position":{{"x":0.10000000000000001,"y":0,"z":0}},{_Q}',
}


def decided() -> dict[str, str]:
    """What becomes of each message: `taken`, or the code and requirement of the error."""
    answers = {}
    for name, members in DECIDED.items():
        try:
            received(f'{{"type":"camera_pose",{members}}}')
            answers[name] = "taken"
        except ProtocolError as error:
            answers[name] = f"{error.code} [{error.requirement}]"
    return answers


def measure(draws: int, climbs: int) -> list[dict[str, Any]]:
    return [{"set": name} | worst(draw, draws, climbs) for name, draw in TAKEN.items()]
