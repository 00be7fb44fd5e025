"""How far is the kernel's depth from the exact one, in units in the last place of float32?

Every estimator, over inputs that are random, tiny, huge, subnormal, half precision or no numbers at
all. The exact quotient is taken in float64, which is 2^-29 of a ULP away from the true one. Covered
pixels must hold the nearest float32 (0.5 ULP), or the largest one where that overflows; all others
must be empty. Colour must be clamped exactly.

    python -m benchmarks cuda_accuracy [--millions 8]
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks import _cuda, _shared
from benchmarks._cuda import Buffer, Device, api, call

LARGEST = float(np.finfo(np.float32).max)
LEAST_ALPHA = np.float32(1.0 / 255.0)
WIDTH = 4096
KINDS: Any = ("linear", "inverse", "accumulated")
Planes = tuple[np.ndarray, np.ndarray]


def inputs(count: int) -> dict[str, Planes]:
    """Depth as accumulated, and alpha."""
    random = np.random.default_rng(11)

    def between(low: float, high: float) -> np.ndarray:
        return (10.0 ** random.uniform(low, high, count)).astype(np.float32)

    def bits() -> np.ndarray:
        return random.integers(0, 1 << 32, count, np.uint32).view(np.float32)

    alpha = random.uniform(0.0, 1.0, count).astype(np.float32)
    return {
        "scene: depth 0.01 to 100": (between(-2, 2), alpha),
        "tiny: 1e-45 to 1e-37": (between(-45, -37), alpha),
        "huge: 1e30 to 3e38": (between(30, 38.4), alpha),
        "near the cut: alpha 1/255 ± 4 ULP": (
            between(-2, 2),
            (LEAST_ALPHA.view(np.int32) + random.integers(-4, 5, count, np.int32)).view(np.float32),
        ),
        "any bits, NaN and infinity too": (bits(), bits()),
        "uncovered: depth ≤ 0 or NaN": (
            random.choice(np.array([0, -0.0, -1, np.nan, -np.inf], np.float32), count),
            alpha,
        ),
    }


def exact(kind: str, depth: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        d, a = depth.astype(np.float64), alpha.astype(np.float64)
        return {"linear": d, "inverse": a / d, "accumulated": d / a}[kind]


def measure(million: int) -> list[dict[str, Any]]:
    from splatbus_server.cuda.memory import DeviceMemory
    from splatbus_wire.semantics import Semantics

    height = million * (1 << 20) // WIDTH
    shape = height, WIDTH
    device = Device(0)
    rows = []
    with device.current():
        memory = DeviceMemory(WIDTH, height, 1, Semantics(), device)
        color, planes = Buffer((*shape, 3)), [Buffer(shape), Buffer(shape)]
        call(api.cuMemsetD8, color.pointer, 0, color.bytes)
        found = np.empty(shape, np.float32)
        for name, given in inputs(height * WIDTH).items():
            for plane, array in zip(planes, given, strict=True):
                call(api.cuMemcpyHtoD, plane.pointer, array.ctypes.data, plane.bytes)
            depth, alpha = (array.reshape(shape) for array in given)
            for kind in KINDS:
                fill = memory.writer(color, planes[0], planes[1], kind, None)
                fill(0, frozenset({"color", "depth"}))
                call(api.cuCtxSynchronize)
                call(api.cuMemcpyDtoH, found.ctypes.data, memory._places[0][1], found.nbytes)
                verdict = judged(kind, depth, alpha, found[::-1])
                rows.append(_shared.told({"inputs": name, "kind": kind, **verdict}))
        memory.close()
    return rows


def judged(kind: str, depth: np.ndarray, alpha: np.ndarray, found: np.ndarray) -> dict[str, Any]:
    right = exact(kind, depth, alpha)
    covered = (depth > 0) & (depth <= LARGEST) & (alpha >= LEAST_ALPHA) & (alpha <= LARGEST)
    vanished = covered & (right <= 2.0**-150)  # nearer to 0, which is no depth, than to any number
    overflowed = covered & (right > LARGEST)
    judged = covered & ~vanished & ~overflowed
    with np.errstate(all="ignore"):
        ulp = np.spacing(right[judged].astype(np.float32)).astype(np.float64)
        errors = np.abs(found[judged] - right[judged]) / ulp
    worst: dict[str, Any] = {"worst_ulp": None}
    if errors.size:
        at = int(errors.argmax())
        worst = {
            "worst_ulp": round(float(errors[at]), 9),
            "worst_at": [float(depth[judged][at]), float(alpha[judged][at])],
        }
    return {
        "covered": int(covered.sum()),
        **worst,
        "overflowed": int(overflowed.sum()),
        "overflowed_wrong": int((found[overflowed] != np.float32(LARGEST)).sum()),
        "empty": int((~covered | vanished).sum()),
        "empty_wrong": int((found[~covered | vanished] != math.inf).sum()),
    }


def main() -> None:
    options = _shared.options(__doc__, millions=8)
    _cuda.require_gpu()
    rows = measure(options.millions)
    _cuda.write("cuda_accuracy", {"pixels_a_row": options.millions << 20, "rows": rows})


if __name__ == "__main__":
    main()
