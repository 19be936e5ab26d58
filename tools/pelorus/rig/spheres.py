# SPDX-License-Identifier: MIT
"""Lenses for wide angles that project by way of a sphere: the part before K.

omni   unified (Mei and Rives 2007): onto a sphere, seen from a point xi above its middle
eucm   enhanced unified (Khomutenko et al. 2016): alpha, beta
ds     double sphere (Usenko et al. 2018): xi, alpha

`onto_plane` maps rays (n, 2), x/z and y/z, to the plane m of a pinhole, `from_plane` maps back; NaN
where there is no ray ahead. Omni is followed by a pinhole's distortion.
"""

from __future__ import annotations

import numpy as np

from pelorus.wire.layout import Floats

PARAMETERS = {"omni": 1, "eucm": 2, "ds": 2}  # before those of the distortion


def onto_plane(model: str, parameters: tuple[float, ...], rays: Floats) -> Floats:
    """Maps rays ahead of the camera to m."""
    r2 = np.sum(rays**2, axis=1)
    if model == "eucm":
        alpha, beta = parameters
        return np.asarray(rays / (alpha * np.sqrt(beta * r2 + 1) + 1 - alpha)[:, None])
    length = np.sqrt(r2 + 1)
    if model == "omni":
        return np.asarray(rays / (1 + parameters[0] * length)[:, None])
    xi, alpha = parameters
    z = xi * length + 1
    return np.asarray(rays / (alpha * np.sqrt(r2 + z**2) + (1 - alpha) * z)[:, None])


def from_plane(model: str, parameters: tuple[float, ...], m: Floats) -> Floats:
    """Maps m to rays; NaN where none is ahead."""
    r2 = np.sum(m**2, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        if model == "omni":
            z = 1 - parameters[0] * (1 + r2) / (
                parameters[0] + np.sqrt(1 + (1 - parameters[0] ** 2) * r2)
            )
        elif model == "eucm":
            alpha, beta = parameters
            z = _lifted(alpha, beta, r2)
        else:
            xi, alpha = parameters
            up = _lifted(alpha, 1.0, r2)
            k = (up * xi + np.sqrt(up**2 + (1 - xi**2) * r2)) / (up**2 + r2)
            z = up - xi / k
        return np.where((z > 0)[:, None], m / z[:, None], np.nan)


def _lifted(alpha: float, beta: float, r2: Floats) -> Floats:
    root = np.sqrt(1 - (2 * alpha - 1) * beta * r2)
    return np.asarray((1 - beta * alpha**2 * r2) / (alpha * root + 1 - alpha))
