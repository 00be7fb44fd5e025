"""Files of 3DGS: PLY whose vertices are Gaussians (Kerbl et al. 2023, `save_ply` of INRIA's code).

A vertex has x, y, z; f_dc_0 to f_dc_2, the constant harmonic of each channel; f_rest_0 and on, the
others, all of red first, then green, then blue; opacity, whose logistic function is the opacity;
scale_0 to scale_2, whose exponentials are the standard deviations; rot_0 to rot_3, a quaternion
w, x, y, z of any norm. In whatever order, among whatever else; what more there is of Gaussians that
live in time is in `spacetime`, where f_dc_0 to f_dc_2 are the colour itself if no f_rest_0 follows.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from splatbus_splats.drawing.harmonics import CONSTANT as CONSTANT_HARMONIC
from splatbus_splats.files import container, spacetime
from splatbus_splats.files.header import Element, Header, read_header
from splatbus_splats.files.spacetime import Members, Motion
from splatbus_splats.gaussians import COEFFICIENTS, Gaussians, Vector, counted_from

PLACE = ("x", "y", "z")
CONSTANT = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALE = ("scale_0", "scale_1", "scale_2")
TURN = ("rot_1", "rot_2", "rot_3", "rot_0")
"""In the order x, y, z, w."""
SCALAR = "scalar_"
NEEDED = (*PLACE, *CONSTANT, "opacity", *SCALE, *TURN)


class Vertices(NamedTuple):
    """What a file has of Gaussians, before they are read."""

    path: Path
    header: Header
    element: Element
    place: container.Place
    coefficients: int
    """How many harmonics a channel has."""
    time: Members | None
    """What there is of their lives in time, if they have any."""


def vertices(file: BufferedReader, path: Path) -> Vertices:
    """What the file says of its vertices.

    Raises:
        ValueError: it is no file of 3DGS; the message names it, what is wrong where, and what else
            it may be.
    """
    header = read_header(file, path)
    if all(each.name != "vertex" for each in header.elements):
        raise ValueError(f"{path}: no splat file: it has no element vertex")
    header = header._replace(elements=list(map(_plainly_named, header.elements)))
    element = next(each for each in header.elements if each.name == "vertex")
    properties = {each.name: each for each in element.properties}
    if missing := [name for name in NEEDED if name not in properties]:
        hint = "it is a mesh or a cloud of points, and what 3DGS trains is point_cloud.ply"
        if missing == ["scale_2"]:
            hint = "its Gaussians are flat ones (2DGS), which are not drawn"
        elif CONSTANT[0] in properties:
            hint = "it is no plain file of 3DGS"
        raise ValueError(
            f"{path}: no splat file: its vertices have no property {', '.join(missing)}: {hint}"
        )
    if "filter_3D" in properties:
        raise ValueError(
            f"{path}: it has the property filter_3D, without which Mip-Splatting's Gaussians look"
            " otherwise: fuse it first, by create_fused_ply.py of that code"
        )
    rest = sum(name.startswith("f_rest_") for name in properties)
    if rest % 3 or 1 + rest // 3 not in COEFFICIENTS:
        allowed = ", ".join(str(3 * (each - 1)) for each in COEFFICIENTS)
        raise ValueError(f"{path}: {rest} properties f_rest_*, where there are {allowed}")
    for name in _rest(rest):
        if name not in properties:
            raise ValueError(f"{path}: {rest} properties f_rest_*, but no {name}")
    for each in element.properties:
        if each.length:
            raise ValueError(f"{path}: the property {each.name} is a list, and not a number")
    time = spacetime.members(path, properties)
    place = container.found(file, path, header, element)
    return Vertices(path, header, element, place, 1 + rest // 3, time)


def parts(
    file: BufferedReader, vertices: Vertices, step: int, origin: Vector
) -> Iterator[tuple[Gaussians, Motion | None]]:
    """What the vertices say, so many at a time, not yet looked at; counted from an origin."""
    path, header, element, place, coefficients, time = vertices
    for rows in container.pieces(file, path, header, element, place, step):
        gaussians = _decoded(rows, coefficients, origin)
        if time is None:
            yield gaussians, None
            continue
        if coefficients == 1:
            gaussians.coefficients[:] -= np.float32(0.5)
            gaussians.coefficients[:] /= np.float32(CONSTANT_HARMONIC)
        with np.errstate(over="ignore", under="ignore"):
            yield gaussians, spacetime.decoded(rows, time)


def first_rows(file: BufferedReader, vertices: Vertices, most: int) -> NDArray[Any]:
    """As they are in the file, so many of them."""
    path, header, element, place, *_ = vertices
    pieces = container.pieces(file, path, header, element, place, most)
    return next(pieces, np.empty(0, [(each.name, "f4") for each in element.properties]))


def is_activated(rows: NDArray[Any]) -> bool:
    """Whether opacities and scales look as if they were no logits and logarithms any more."""
    opacities, scales = rows["opacity"], _columns(rows, SCALE)
    return len(rows) > 1 and bool(
        (opacities >= 0.0).all() and (opacities <= 1.0).all() and (scales > 0.0).all()
    )


def write(path: Path, gaussians: Gaussians, *comments: str) -> None:
    """Writes them as 3DGS does, little-endian; scales of 0, opacities of 0 and 1 as infinities."""
    K = gaussians.coefficients.shape[1]
    names = (*PLACE, "nx", "ny", "nz", *CONSTANT, *_rest(3 * (K - 1)), "opacity", *SCALE, *TURN)
    order = [*names[:-4], "rot_0", "rot_1", "rot_2", "rot_3"]
    wide = dict.fromkeys(PLACE, gaussians.means.dtype)
    rows = np.zeros(len(gaussians), [(name, wide.get(name, "<f4")) for name in order])
    with np.errstate(divide="ignore"):
        opacities = gaussians.opacities.astype(np.float64)
        columns = {
            PLACE: gaussians.means,
            CONSTANT: gaussians.coefficients[:, 0],
            SCALE: np.log(gaussians.scales),
            TURN: gaussians.rotations,
            ("opacity",): np.log(opacities / (1.0 - opacities))[:, None],
            _rest(3 * (K - 1)): gaussians.coefficients[:, 1:].swapaxes(1, 2).reshape(len(rows), -1),
        }
    for group, values in columns.items():
        for name, column in zip(group, values.T):
            rows[name] = column
    container.write(path, rows, *comments)


@np.errstate(over="ignore", under="ignore")  # what is infinite in float32 is left out later
def _decoded(rows: NDArray[Any], coefficients: int, origin: Vector) -> Gaussians:
    """What some vertices say: quaternions have the norm that they have."""
    harmonics = np.empty((len(rows), coefficients, 3), np.float32)
    harmonics[:, 0] = _columns(rows, CONSTANT)
    for i, name in enumerate(_rest(3 * (coefficients - 1))):
        channel, place = divmod(i, coefficients - 1)
        harmonics[:, 1 + place, channel] = rows[name]
    opacities = 1.0 / (1.0 + np.exp(-rows["opacity"].astype(np.float64)))
    return Gaussians(
        counted_from(origin, np.stack([rows[name] for name in PLACE], axis=1)),
        _columns(rows, TURN),
        np.exp(_columns(rows, SCALE)),
        opacities.astype(np.float32),
        harmonics,
    )


def _plainly_named(element: Element) -> Element:
    """Without what CloudCompare puts before the names that it does not know."""
    names = {each.name for each in element.properties}
    plain = [
        each._replace(name=each.name[len(SCALAR) :])
        if each.name.startswith(SCALAR) and each.name[len(SCALAR) :] not in names
        else each
        for each in element.properties
    ]
    return element._replace(properties=plain)


def _rest(count: int) -> tuple[str, ...]:
    return tuple(f"f_rest_{i}" for i in range(count))


def _columns(rows: NDArray[Any], names: tuple[str, ...]) -> NDArray[np.float32]:
    return np.stack([rows[name].astype(np.float32) for name in names], axis=1)
