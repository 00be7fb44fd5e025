"""Gaussians in a glTF 2.0 by KHR_gaussian_splatting: of every point primitive that has them.

An attribute is called as in `NAMES` or SH_DEGREE_l_COEF_n. Scales are linear and opacities in
[0, 1]; drafts of the extension had logarithms for scales, which a negative number shows. Axes are
the scene's, y upwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from splatbus_wire.rotations import quaternion_from_matrix, rotation_matrix

from splatbus_splats.drawing import harmonics
from splatbus_splats.gaussians import COEFFICIENTS, Gaussians

EXTENSION = "KHR_gaussian_splatting"
NAMES = ("ROTATION", "SCALE", "OPACITY")
NUMBERS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""NumPy's letters and bytes, by componentType."""
COLUMNS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
UNEVEN = 1e-3
"""By how much, of the whole, a node may scale one axis otherwise than another."""
Array = NDArray[Any]


class Placement(NamedTuple):
    """What a node does to the Gaussians of its mesh: scale, then turn, then move."""

    scale: float
    turn: Array
    """(3, 3)."""
    move: Array
    """(3,)."""


def read(path: Path) -> Gaussians:
    """All Gaussians in a `.glb` or `.gltf`, in the axes of its scene; their means in float64, for a
    node may move them far.

    Raises:
        ValueError: it is none, or has none that can be drawn; the message says why.
        OSError: it, or a file beside it, cannot be read.
    """
    from pygltflib import GLTF2  # of the extra, and slow to import

    model = GLTF2().load(str(path))
    parts = [
        _placed(_gaussians(model, primitive), placement)
        for mesh, placement in _meshes(model)
        for primitive in model.meshes[mesh].primitives
        if EXTENSION in (primitive.extensions or {})
    ]
    if not parts:
        raise ValueError(f"nothing in its scene has {EXTENSION}: it is a mesh")
    most = max(each.coefficients.shape[1] for each in parts)
    columns = zip(*(vars(_widened(each, most)).values() for each in parts))
    return Gaussians(*(np.concatenate(each) for each in columns))


def _meshes(model: Any) -> Iterator[tuple[int, Placement]]:
    """Each mesh of the scene, as often as it is there, and how it lies."""
    scene = model.scenes[model.scene or 0] if model.scenes else None
    left = [(node, np.eye(4)) for node in (scene.nodes if scene else range(len(model.nodes)))]
    for _ in range(len(model.nodes)):  # each has one parent, so a circle ends here
        if not left:
            return
        number, above = left.pop()
        node = model.nodes[number]
        matrix = above @ _matrix(node)
        left += [(child, matrix) for child in node.children or ()]
        if node.mesh is not None:
            yield node.mesh, _placement(matrix)


def _matrix(node: Any) -> Array:
    if node.matrix is not None:
        return np.array(node.matrix, np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    turn = rotation_matrix(tuple(node.rotation or (0.0, 0.0, 0.0, 1.0)))
    matrix[:3, :3] = np.reshape(turn, (3, 3)) * (node.scale or 1.0)
    matrix[:3, 3] = node.translation or 0.0
    return matrix


def _placement(matrix: Array) -> Placement:
    linear = matrix[:3, :3]
    scale = float(np.cbrt(np.linalg.det(linear)))
    if not (scale > 0.0 and np.allclose(linear @ linear.T, scale**2 * np.eye(3), rtol=UNEVEN)):
        raise ValueError("a node of it mirrors Gaussians, or scales their axes unevenly")
    return Placement(scale, linear / scale, matrix[:3, 3])


def _gaussians(model: Any, primitive: Any) -> Gaussians:
    """Those of a primitive, in its own axes."""
    attributes = vars(primitive.attributes)
    there = [d for d in range(4) if f"{EXTENSION}:SH_DEGREE_{d}_COEF_0" in attributes]
    degrees = range(1 + max(there, default=0))
    bands = [f"SH_DEGREE_{d}_COEF_{n}" for d in degrees for n in range(2 * d + 1)]
    needed = ["POSITION", *(f"{EXTENSION}:{it}" for it in (*NAMES, *bands))]
    if missing := [name for name in needed if attributes.get(name) is None]:
        packed = ", ".join(primitive.extensions[EXTENSION].get("extensions", ()))
        hint = f"; it is packed by {packed}, which is not read" if packed else ""
        raise ValueError(f"it has no attribute {missing[0]}{hint}")
    means, turns, scales, opacities, *colors = (_column(model, attributes[it]) for it in needed)
    if (scales < 0.0).any():
        scales = np.exp(scales)
    return Gaussians(means, turns, scales, opacities[:, 0], np.stack(colors, axis=1))


def _column(model: Any, number: int) -> Array:
    """(N, 1 to 4), what an accessor gives, in float32."""
    accessor = model.accessors[number]
    if accessor.sparse is not None or accessor.bufferView is None:
        raise ValueError(f"/accessors/{number} is sparse, which is not read")
    view = model.bufferViews[accessor.bufferView]
    data = model.get_data_from_buffer_uri(model.buffers[view.buffer].uri)
    dtype, columns = np.dtype(NUMBERS[accessor.componentType]), COLUMNS[accessor.type]
    stride = view.byteStride or dtype.itemsize * columns
    begin = (view.byteOffset or 0) + (accessor.byteOffset or 0)
    need = begin + stride * (accessor.count - 1) + dtype.itemsize * columns
    if data is None or begin < 0 or len(data) < need:
        raise ValueError(f"/accessors/{number} reaches beyond its buffer: it is cut short")
    shape, strides = (accessor.count, columns), (stride, dtype.itemsize)
    values = np.ndarray(shape, dtype, data, begin, strides).astype(np.float32)
    if accessor.normalized and dtype.kind in "iu":
        values = np.maximum(values / np.float32(np.iinfo(dtype).max), np.float32(-1.0))
    return values


def _placed(gaussians: Gaussians, placement: Placement) -> Gaussians:
    """The same in the axes of the scene."""
    scale, turn, move = placement
    x, y, z, w = quaternion_from_matrix(tuple(turn.ravel()))
    product = np.array([(w, -z, y, x), (z, w, -x, y), (-y, x, w, z), (-x, -y, -z, w)])
    arrays: tuple[Array, ...] = (
        gaussians.means @ (turn * scale).T + move,
        gaussians.rotations @ product.T,
        gaussians.scales * scale,
        gaussians.opacities,
        np.einsum("ij,njc->nic", _turned(turn, gaussians.degree), gaussians.coefficients),
    )
    means, *others = arrays
    return Gaussians(means, *(np.ascontiguousarray(each, np.float32) for each in others))


def _turned(turn: Array, degree: int) -> Array:
    """(K, K), what coefficients are multiplied by when what they colour is turned.

    Harmonics of a degree stay among themselves, so that as many directions as there are of them,
    and some more, tell how.
    """
    K = COEFFICIENTS[degree]
    sights = np.random.default_rng(0).normal(size=(4 * K, 3))
    sights /= np.linalg.norm(sights, axis=1, keepdims=True)
    pair = sights, sights @ turn
    there, here = (np.stack(harmonics.values(*each.T)[:K], axis=1) for each in pair)
    return np.asarray(np.linalg.lstsq(there, here, rcond=None)[0])


def _widened(gaussians: Gaussians, coefficients: int) -> Gaussians:
    """The same with harmonics of 0 for those that it has not."""
    more = coefficients - gaussians.coefficients.shape[1]
    padded = np.pad(gaussians.coefficients, ((0, 0), (0, more), (0, 0)))
    return replace(gaussians, coefficients=padded)
