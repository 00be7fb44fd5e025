"""From a quaternion to the nine numbers of its rotation matrix [ACC-2, ACC-3]."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from splatbus_conformance import oracle
from splatbus_wire.rotations import Matrix3, Quaternion, rotation_matrix

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst
from benchmarks.accuracy.timing import each

TIMED = 1000


def in_order(q: Quaternion) -> Matrix3:
    """The default, but with ‖q‖² summed in order."""
    x, y, z, w = q
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    s = 2.0 / (xx + yy + zz + ww)
    h = 0.5 * s
    xy, xz, yz = x * y, x * z, y * z
    xw, yw, zw = x * w, y * w, z * w
    return (
        h * ((ww + xx) - (yy + zz)), s * (xy - zw), s * (xz + yw),
        s * (xy + zw), h * ((ww + yy) - (xx + zz)), s * (yz - xw),
        s * (xz - yw), s * (yz + xw), h * ((ww + zz) - (xx + yy)),
    )  # fmt: skip


def in_pairs(q: Quaternion) -> Matrix3:
    """The default, but with ‖q‖² summed in pairs that the diagonal needs too."""
    x, y, z, w = q
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    wx, yz = ww + xx, yy + zz
    s = 2.0 / (wx + yz)
    h = 0.5 * s
    xy, xz, y_z = x * y, x * z, y * z
    xw, yw, zw = x * w, y * w, z * w
    return (
        h * (wx - yz), s * (xy - zw), s * (xz + yw),
        s * (xy + zw), h * ((ww + yy) - (xx + zz)), s * (y_z - xw),
        s * (xz - yw), s * (y_z + xw), h * ((ww + zz) - (xx + yy)),
    )  # fmt: skip


def divided(q: Quaternion) -> Matrix3:
    """Each entry divided by ‖q‖², in place of a factor that is rounded already."""
    x, y, z, w = q
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    n = math.fsum((xx, yy, zz, ww))
    h = 0.5 * n
    xy, xz, yz = x * y, x * z, y * z
    xw, yw, zw = x * w, y * w, z * w
    return (
        ((ww + xx) - (yy + zz)) / n, (xy - zw) / h, (xz + yw) / h,
        (xy + zw) / h, ((ww + yy) - (xx + zz)) / n, (yz - xw) / h,
        (xz - yw) / h, (yz + xw) / h, ((ww + zz) - (xx + yy)) / n,
    )  # fmt: skip


def textbook(q: Quaternion) -> Matrix3:
    """The diagonal as 1 − s·(y² + z²)."""
    x, y, z, w = q
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return _from_unit(x, y, z, w, s)


def normalised(q: Quaternion) -> Matrix3:
    """q/‖q‖ first, then the formula for unit quaternions."""
    n = math.hypot(*q)
    x, y, z, w = q
    return _from_unit(x / n, y / n, z / n, w / n, 2.0)


def deployed(q: Quaternion) -> Any:
    """The formula for unit quaternions whatever the norm, in float64, then float32."""
    x, y, z, w = q
    return np.array(_from_unit(x, y, z, w, 2.0), np.float32)


def _from_unit(x: float, y: float, z: float, w: float, s: float) -> Matrix3:
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz = x * y, x * z, y * z
    xw, yw, zw = x * w, y * w, z * w
    return (
        1.0 - s * (yy + zz), s * (xy - zw), s * (xz + yw),
        s * (xy + zw), 1.0 - s * (xx + zz), s * (yz - xw),
        s * (xz - yw), s * (yz + xw), 1.0 - s * (xx + yy),
    )  # fmt: skip


def with_numpy(q: Quaternion) -> Any:
    """(w² − v·v)·I + 2·v·vᵀ + 2·w·[v]×, over ‖q‖²."""
    v, w = np.array(q[:3]), q[3]
    x, y, z = q[:3]
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    vv = v @ v
    return ((w * w - vv) * np.eye(3) + 2.0 * (np.outer(v, v) + w * cross)) / (vv + w * w)


def single(q: Quaternion) -> Any:
    """Float32 from the start."""
    x, y, z, w = np.array(q, np.float32)
    s = np.float32(2.0) / (x * x + y * y + z * z + w * w)
    return _from_unit(x, y, z, w, s)


def with_scipy(q: Quaternion) -> Any:
    """SciPy normalises first."""
    return Rotation.from_quat(q).as_matrix()


def exact(q: Quaternion) -> Any:
    """Rational numbers, rounded once at the end."""
    return [float(a) for row in oracle.rotation_matrix(q) for a in row]


def unpacked(q: Quaternion) -> Matrix3:
    """The floor: nine numbers that need no arithmetic."""
    x, y, z, w = q
    return x, y, z, w, x, y, z, w, x


VARIANTS = (
    Variant("default: ‖q‖² exactly, Σ±squares", rotation_matrix, "default"),
    Variant("‖q‖² in order", in_order),
    Variant("‖q‖² in pairs", in_pairs),
    Variant("divided by ‖q‖²", divided),
    Variant("1 − s(y²+z²)", textbook),
    Variant("normalised first", normalised),
    Variant("deployed: not normalised, float32", deployed, "deployed"),
    Variant("float32 throughout", single),
    Variant("NumPy", with_numpy),
    Variant("SciPy", with_scipy),
    Variant("rational numbers", exact, slow=True),
)

U = float(oracle.U)


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    pool = [search.quaternions(source) for _ in range(search.DRAWN)]
    pool += [tuple(q) for q in known]

    def entries(q: Any) -> list[float]:
        return search.floats(variant.compute(q))

    def entry(q: Any) -> float:
        return integers.entry_error(entries(q), integers.rotation(q)) / U

    def entry_restated(q: Any) -> float:
        return oracle.error_in_u(entries(q), sum(oracle.rotation_matrix(q), ()))

    def orthogonality(q: Any) -> float:
        return integers.orthogonality_error(entries(q)) / U

    def orthogonality_restated(q: Any) -> float:
        R = entries(q)
        return oracle.orthogonality_error((R[:3], R[3:6], R[6:])) / U

    return [
        search.climb(error, pool, search.unit, restated, variant.effort)
        for error, restated in ((entry, entry_restated), (orthogonality, orthogonality_restated))
    ]


def study() -> Study:
    source = random.Random(search.SEED)
    items = [search.quaternions(source) for _ in range(TIMED)]
    measures = (
        Measure("An entry of R", "u", 8.0, "ACC-2"),
        Measure("‖RᵀR − I‖₂", "u", 16.0, "ACC-3"),
    )
    part = Part(
        item="quaternion",
        items=TIMED,
        floor_title="a function that unpacks q and returns nine numbers",
        floor=each(unpacked, items),
        run=lambda compute: each(compute, items),
        worst=worst,
        variants=VARIANTS,
        measures=measures,
    )
    return Study("Quaternion to rotation matrix", [part])
