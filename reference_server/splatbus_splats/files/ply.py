"""Files of 3DGS: PLY whose vertices are Gaussians (Kerbl et al. 2023, `save_ply` of INRIA's code).

A vertex has x, y, z; f_dc_0 to f_dc_2, the constant harmonic of each channel; f_rest_0 and on, the
others, all of red first, then green, then blue; opacity, whose logistic function is the opacity;
scale_0 to scale_2, whose exponentials are the standard deviations; rot_0 to rot_3, a quaternion
w, x, y, z of any norm. In whatever order, among whatever else. The container is read by plyfile.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
from numpy.typing import NDArray

from splatbus_splats.gaussians import COEFFICIENTS, Gaussians

PLACE = ("x", "y", "z")
CONSTANT = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALE = ("scale_0", "scale_1", "scale_2")
TURN = ("rot_1", "rot_2", "rot_3", "rot_0")
"""In the order x, y, z, w."""
NEEDED = (*PLACE, *CONSTANT, "opacity", *SCALE, *TURN)


def vertices(path: Path) -> tuple[NDArray[Any], int]:
    """The vertices as they lie in the file, and how many harmonics a channel has.

    Those of a binary file are mapped, not read.

    Raises:
        ValueError: it is no file of 3DGS; the message says what is wrong, and where.
        OSError: it cannot be read.
    """
    try:
        elements = plyfile.PlyData.read(str(path))
    except plyfile.PlyHeaderParseError as error:
        raise ValueError(f"{path}: no PLY file: {error}") from error
    except plyfile.PlyElementParseError as error:
        raise ValueError(f"{path}: {error}{_place(path, error)}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: byte {error.start} is none of a text") from error
    except (ValueError, MemoryError, OverflowError) as error:
        raise ValueError(f"{path}: no PLY file that can be read: {error}") from error
    if "vertex" not in elements:
        raise ValueError(f"{path}: no splat file: it has no element vertex")
    element = elements["vertex"]
    names = {each.name for each in element.properties}
    if missing := [name for name in NEEDED if name not in names]:
        hint = ", but packed_position: it is a compressed one" * ("packed_position" in names)
        raise ValueError(
            f"{path}: no splat file: its vertices have no property {', '.join(missing)}{hint}"
        )
    rest = sum(name.startswith("f_rest_") for name in names)
    if rest % 3 or 1 + rest // 3 not in COEFFICIENTS:
        allowed = ", ".join(str(3 * (each - 1)) for each in COEFFICIENTS)
        raise ValueError(f"{path}: {rest} properties f_rest_*, where there are {allowed}")
    for name in (*NEEDED, *_rest(rest)):
        if name not in names:
            raise ValueError(f"{path}: {rest} properties f_rest_*, but no {name}")
        if element.data.dtype[name].kind not in "fiu":
            raise ValueError(f"{path}: the property {name} is a list, and not a number")
    return element.data, 1 + rest // 3


@np.errstate(over="ignore", under="ignore")  # what is infinite in float32 is left out later
def decoded(rows: NDArray[Any], coefficients: int) -> Gaussians:
    """What some vertices say, not yet looked at: quaternions have the norm that they have."""
    harmonics = np.empty((len(rows), coefficients, 3), np.float32)
    harmonics[:, 0] = _columns(rows, CONSTANT)
    for i, name in enumerate(_rest(3 * (coefficients - 1))):
        channel, place = divmod(i, coefficients - 1)
        harmonics[:, 1 + place, channel] = rows[name]
    opacities = 1.0 / (1.0 + np.exp(-rows["opacity"].astype(np.float64)))
    return Gaussians(
        _columns(rows, PLACE),
        _columns(rows, TURN),
        np.exp(_columns(rows, SCALE)),
        opacities.astype(np.float32),
        harmonics,
    )


def parts(rows: NDArray[Any], coefficients: int, step: int) -> Iterator[Gaussians]:
    """What the vertices say, so many at a time."""
    for start in range(0, len(rows), step):
        yield decoded(rows[start : start + step], coefficients)


def write(path: Path, gaussians: Gaussians) -> None:
    """Writes them as 3DGS does, little-endian; scales of 0, opacities of 0 and 1 as infinities."""
    K = gaussians.coefficients.shape[1]
    names = (*PLACE, "nx", "ny", "nz", *CONSTANT, *_rest(3 * (K - 1)), "opacity", *SCALE, *TURN)
    order = [*names[:-4], "rot_0", "rot_1", "rot_2", "rot_3"]
    rows = np.zeros(len(gaussians), [(name, "<f4") for name in order])
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
    element = plyfile.PlyElement.describe(rows, "vertex")
    plyfile.PlyData([element], byte_order="<").write(str(path))


def _rest(count: int) -> tuple[str, ...]:
    return tuple(f"f_rest_{i}" for i in range(count))


def _columns(rows: NDArray[Any], names: tuple[str, ...]) -> NDArray[np.float32]:
    return np.stack([rows[name].astype(np.float32) for name in names], axis=1)


def _place(path: Path, error: Any) -> str:
    """Where a file ends too early."""
    size = path.stat().st_size
    return f"; the file ends at byte {size}" if "end-of-file" in str(error) else ""
