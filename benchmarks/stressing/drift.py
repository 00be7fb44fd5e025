"""Poses composed a million times: how far does each way to hold a pose wander off?

A step is one of 16 small poses (a turn of up to 2 degrees, a move of up to 1 unit, in the axes of
what moves), in a fixed random order, or always the same one. What is exact is the product of the
very steps that a way holds, in double precision, multiplied as a balanced tree: each goes through
20 products instead of a million, which is good to some 1e-14 rad (1e-10 for positions). An error is
thus that of composing, not that of the steps' own rounding; matrices in single precision stand for
the rotations that are nearest to them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.rotations import NORM_TOLERANCE, rotation_matrix

from benchmarks._pictures import pyplot, save

Floats = NDArray[Any]

EXACT = 1e-17
"""Where the picture shows 0."""
STEPS = 16
DEGREES = 2.0
WAYS = {
    "quaternion, float32": ("quaternion", np.float32, False),
    "quaternion, float32, renormalised": ("quaternion", np.float32, True),
    "matrix, float32": ("matrix", np.float32, False),
    "matrix, float32, made orthogonal": ("matrix", np.float32, True),
    "quaternion, float64": ("quaternion", np.float64, False),
    "quaternion, float64, renormalised": ("quaternion", np.float64, True),
    "matrix, float64": ("matrix", np.float64, False),
    "matrix, float64, made orthogonal": ("matrix", np.float64, True),
}

_UNITS = np.eye(4)


def product(p: Floats, q: Floats) -> Floats:
    """The Hamilton product of quaternions x, y, z, w."""
    (a, b, c, d), (e, f, g, h) = p, q
    return np.array(
        (
            d * e + a * h + b * g - c * f,
            d * f - a * g + b * h + c * e,
            d * g + a * f - b * e + c * h,
            d * h - a * e - b * f - c * g,
        )
    )


LEFT = np.stack([[product(p, q) for p in _UNITS] for q in _UNITS]).transpose(2, 0, 1).copy()
"""(4, 4, 4): p·q is (LEFT @ p) @ q."""


def after(q: Floats) -> Floats:
    """The 4×4 matrix of p ↦ p·q."""
    return np.stack([product(p, q) for p in _UNITS], axis=1)


def small_steps(seed: int = 1) -> tuple[Floats, Floats]:
    """(STEPS, 4) unit quaternions x, y, z, w, and (STEPS, 3) moves."""
    random = np.random.default_rng(seed)
    axis = random.normal(size=(STEPS, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = np.radians(random.uniform(0.1, DEGREES, (STEPS, 1))) / 2.0
    moves = random.uniform(-1, 1, (STEPS, 3)) / np.sqrt(3)
    return np.hstack((np.sin(half) * axis, np.cos(half))), moves


def as_matrix(q: Floats) -> Floats:
    return np.array(rotation_matrix(tuple(float(a) for a in q))).reshape(3, 3)


def rigid(R: Floats, moves: Floats) -> Floats:
    """(N, 4, 4) of (N, 3, 3) and (N, 3)."""
    matrices = np.zeros((len(R), 4, 4), R.dtype)
    matrices[:, :3, :3], matrices[:, :3, 3], matrices[:, 3, 3] = R, moves, 1
    return matrices


def checkpoints(count: int) -> list[int]:
    return [n for n in (10**e for e in range(10)) if n <= count]


def order_of_steps(count: int, always_the_same: bool) -> NDArray[np.int64]:
    if always_the_same:
        return np.zeros(count, np.int64)
    return np.random.default_rng(2).integers(0, STEPS, count)


def tree_product(matrices: Floats) -> Floats:
    """M[0]·M[1]·…·M[n−1] of (n, k, k) matrices."""
    while len(matrices) > 1:
        odd = matrices[-1:] if len(matrices) % 2 else matrices[:0]
        pairs = matrices[: len(matrices) - 1 : 2] @ matrices[1::2]
        matrices = np.concatenate((pairs, odd))
    return np.asarray(matrices[0])


def references(steps: Floats, order: NDArray[np.int64]) -> list[Floats]:
    """The product of the steps up to each checkpoint."""
    done, total, found = 0, np.eye(4), []
    for n in checkpoints(len(order)):
        total = total @ tree_product(steps[order[done:n]])
        done = n
        found.append(total)
    return found


def angle(a: Floats, b: Floats) -> float:
    """Between two matrices that are nearly the same rotation, in radians, by their difference."""
    return float(np.linalg.norm(a - b) / np.sqrt(2.0))


def nearest_rotation(R: Floats) -> Floats:
    u, _, v = np.linalg.svd(R.astype(np.float64))
    return np.asarray(u @ v)


def orthogonal(R: Floats) -> Floats:
    """One step of Newton and Schulz towards the nearest rotation, in the matrix's own precision."""
    half = R.dtype.type(0.5)
    return np.asarray(R + half * (R - R @ (R.T @ R)))


def composed(way: str, count: int, always_the_same: bool) -> list[dict[str, Any]]:
    """At each checkpoint: errors of angle and position, and how far it is from a rotation."""
    kind, dtype, _ = WAYS[way]
    order = order_of_steps(count, always_the_same)
    turns, moves = (part.astype(dtype) for part in small_steps())
    R = np.stack([as_matrix(q) for q in turns])
    if kind == "matrix":
        R = R.astype(dtype)
        held = np.stack([nearest_rotation(r) for r in R]) if dtype is np.float32 else R
        poses = references(rigid(held, moves), order)
        rotations = [nearest_rotation(pose[:3, :3]) for pose in poses]
        states = chain_of_matrices(rigid(R, moves), order, WAYS[way][2])
    else:
        poses = references(rigid(R, moves), order)
        # Each p ↦ p·q has the very numbers of q as entries; the last column is what became of 1.
        exact = np.stack([after(q).T for q in turns.astype(np.float64)])
        rotations = [as_matrix(total[3]) for total in references(exact, order)]
        states = chain_of_quaternions(turns, moves, order, WAYS[way][2])
    rows = []
    for n, state, pose, right in zip(checkpoints(count), states, poses, rotations, strict=True):
        turned, off, position = state
        rows.append(
            {
                "way": way,
                "steps": n,
                "same_step": always_the_same,
                "angle": angle(turned, right),
                "off_rotation": off,
                "position": float(np.linalg.norm(position - pose[:3, 3])),
                "distance": float(np.linalg.norm(pose[:3, 3])),
            }
        )
    return rows


State = tuple[Floats, float, Floats]
"""The nearest rotation, how far from it, and the position."""


def chain_of_matrices(steps: Floats, order: NDArray[np.int64], mend: bool) -> list[State]:
    states, marks = [], set(checkpoints(len(order)))
    state, each = np.eye(4, dtype=steps.dtype), list(steps)
    for n, which in enumerate(order.tolist(), 1):
        state = state @ each[which]
        if mend:
            state[:3, :3] = orthogonal(state[:3, :3])
        if n in marks:
            R = state[:3, :3].astype(np.float64)
            off = float(np.linalg.norm(R.T @ R - np.eye(3), 2))
            states.append((nearest_rotation(R), off, state[:3, 3].astype(np.float64)))
    return states


def chain_of_quaternions(
    turns: Floats, moves: Floats, order: NDArray[np.int64], mend: bool
) -> list[State]:
    states, marks = [], set(checkpoints(len(order)))
    dtype = turns.dtype
    q, p = np.array((0, 0, 0, 1), dtype), np.zeros(4, dtype)
    turn = [after(each).astype(dtype) for each in turns]
    move = [after(np.append(each, 0)).astype(dtype) for each in moves]
    left, conjugate = LEFT.astype(dtype), np.array((-1, -1, -1, 1), dtype)
    for n, which in enumerate(order.tolist(), 1):
        p = p + (left @ (move[which] @ q)) @ (conjugate * q)  # q·m·q̄, as if q were a unit one
        q = turn[which] @ q
        if mend:
            q = q / np.sqrt(q @ q)
        if n in marks:
            off = abs(float(np.linalg.norm(q.astype(np.float64))) - 1.0)
            states.append((as_matrix(q), off, p[:3].astype(np.float64)))
    return states


def steps_until_refused(count: int) -> int | None:
    """After how many steps a quaternion in float32, never renormalised, is no longer taken."""
    step = after(small_steps()[0].astype(np.float32)[0]).astype(np.float32)
    state = np.array((0, 0, 0, 1), np.float32)
    for n in range(1, count + 1):
        state = step @ state
        if n % 1000 == 0 and abs(np.linalg.norm(state.astype(np.float64)) - 1.0) > NORM_TOLERANCE:
            return n
    return None


def measure(count: int) -> list[dict[str, Any]]:
    return [row for same in (False, True) for way in WAYS for row in composed(way, count, same)]


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    plt = pyplot()
    figure, panels = plt.subplots(2, 3, figsize=(14, 8), layout="constrained", sharex=True)
    titles = {
        "angle": "angle to the exact rotation (rad)",
        "off_rotation": "| ‖q‖ − 1 |, or ‖RᵀR − I‖",
        "position": "error of the position (units)",
    }
    for line, same in enumerate((False, True)):
        for column, (member, title) in enumerate(titles.items()):
            axes = panels[line][column]
            for way, (kind, dtype, mended) in WAYS.items():
                chosen = [row for row in rows if row["way"] == way and row["same_step"] is same]
                axes.plot(
                    [row["steps"] for row in chosen],
                    [max(row[member], EXACT) for row in chosen],
                    color="C0" if kind == "quaternion" else "C1",
                    linestyle="-" if mended else "--",
                    marker="o" if dtype is np.float64 else "x",
                    label=way,
                )
            axes.set(xscale="log", yscale="log")
            axes.grid(alpha=0.3)
            axes.text(1, EXACT, "0", ha="right", va="top", fontsize=8)
            steps = "the same step" if same else "random steps"
            axes.set_title(f"{title}, {steps}", fontsize=10)
            if member == "off_rotation":
                axes.axhline(NORM_TOLERANCE, color="grey", linestyle=":")
                axes.text(1, NORM_TOLERANCE, "refused by POS-3", va="top", fontsize=8)
    for axes in panels[1]:
        axes.set_xlabel("poses composed")
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    save(figure, path)
