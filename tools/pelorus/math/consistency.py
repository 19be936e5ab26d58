# SPDX-License-Identifier: MIT
"""Compares errors with their covariances."""

from __future__ import annotations

import numpy as np

from pelorus.wire.layout import Floats

Figures = dict[str, float | int | None]


def nees_per_dof(error: Floats, P: Floats) -> Floats:
    """Returns e^T P^-1 e / d of (n, d) and (n, d, d); NaN where P is not positive."""
    out = np.full(len(error), np.nan)
    finite = np.nonzero(np.isfinite(P).all(axis=(1, 2)))[0]
    sound = finite[np.linalg.eigvalsh(P[finite])[:, 0] > 0]
    weighted = np.linalg.solve(P[sound], error[sound, :, None])[..., 0]
    out[sound] = np.sum(error[sound] * weighted, axis=1) / error.shape[1]
    return out


def rms(errors: Floats) -> float:
    """Returns the root of the mean squared norm of the rows."""
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=-1))))


def mean(values: Floats) -> float | None:
    """Returns the mean of the finite values; None if there is none."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else None
