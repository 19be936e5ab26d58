# SPDX-License-Identifier: MIT
"""Symmetric matrices as the frames hold them: lower triangles, row by row."""

from __future__ import annotations

import numpy as np

from pelorus.se3 import Floats


def unpack_symmetric(packed: Floats, size: int) -> Floats:
    """(n, size (size + 1) / 2) -> (n, size, size)."""
    out = np.zeros((len(packed), size, size))
    rows, columns = np.tril_indices(size)
    out[:, rows, columns] = packed
    out[:, columns, rows] = packed
    return out


def pack_symmetric(whole: Floats) -> Floats:
    """(..., size, size) -> (..., size (size + 1) / 2)."""
    rows, columns = np.tril_indices(whole.shape[-1])
    return np.asarray(whole[..., rows, columns])
