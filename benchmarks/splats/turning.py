"""Harmonics of Gaussians that are turned, and those that come nearest to given colours."""

from __future__ import annotations

import numpy as np
from splatbus_splats.drawing.harmonics import BANDS, Floats, basis, spread_directions

_DIRECTIONS = spread_directions(64)
_INVERSES = [np.linalg.pinv(basis(_DIRECTIONS)[band]) for band in BANDS]


def band_rotation(R: Floats, degree: int) -> Floats:
    """M with Y(R·d) = M·Y(d) for every d: the Wigner matrix of a degree, in the real basis.

    The harmonics of a degree turn among themselves, so that their values at a few directions,
    before and after, determine M by least squares: no recursion, and no sign to get wrong.
    """
    return np.asarray(basis(_DIRECTIONS @ R.T)[BANDS[degree]] @ _INVERSES[degree])


def turned(coefficients: Floats, R: Floats) -> Floats:
    """The coefficients of Gaussians that are turned by R, (k, 3, N) as they came."""
    moved = np.empty(coefficients.shape, coefficients.dtype)  # contiguous, whatever came
    for degree, band in enumerate(BANDS):
        if band.start < len(coefficients):
            M = band_rotation(R, degree).astype(coefficients.dtype)
            part = coefficients[band].reshape(len(M), -1)
            np.matmul(M, part, out=moved[band].reshape(part.shape))
    return moved


def fitted(values: Floats, directions: Floats) -> Floats:
    """The (16, 3, N) coefficients whose colours are nearest to (N, D, 3) values at D directions."""
    inverse = np.linalg.pinv(basis(directions))
    return np.asarray(np.einsum("dk,ndc->kcn", inverse, values - 0.5))
