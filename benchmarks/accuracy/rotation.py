"""From a quaternion to the nine numbers of its rotation matrix [ACC-2, ACC-3]."""

from __future__ import annotations

import math
import random
from functools import partial
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_wire.rotations import Matrix3, Quaternion, rotation_matrix

from benchmarks.accuracy import integers, search
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, each

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


def unpacked(q: Quaternion) -> Matrix3:
    """The floor: nine numbers that need no arithmetic."""
    x, y, z, w = q
    return x, y, z, w, x, y, z, w, x


VARIANTS = (
    Variant("default: ‖q‖² exactly, Σ±squares", rotation_matrix, "default"),
    Variant("‖q‖² in order", in_order),
    Variant("divided by ‖q‖²", divided),
    Variant("1 − s(y²+z²)", textbook),
    Variant("normalised first", normalised),
    Variant("deployed: not normalised, float32", deployed, "deployed"),
)

U = float(oracle.U)


def entry(compute: Compute, q: search.Numbers) -> float:
    return integers.entry_error(search.floats(compute(q)), integers.rotation(q)) / U


def orthogonality(compute: Compute, q: search.Numbers) -> float:
    return integers.orthogonality_error(search.floats(compute(q))) / U


def study() -> Study:
    source = random.Random(search.SEED)
    items = [search.quaternions(source) for _ in range(TIMED)]
    return Study(
        title="Quaternion to rotation matrix",
        item="quaternion",
        items=TIMED,
        floor_title="a function that unpacks q and returns nine numbers",
        floor=each(items, unpacked),
        run=partial(each, items),
        variants=VARIANTS,
        measures=(
            Measure("An entry of R", "u", 8.0, "ACC-2"),
            Measure("‖RᵀR − I‖₂", "u", 16.0, "ACC-3"),
        ),
        worst=search.climbing((entry, orthogonality), search.quaternions, search.unit),
    )
