# SPDX-License-Identifier: MIT
"""Stereo tracks: which landmark id was seen where in which frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.io.foreign import ForeignFileError
from pelorus.wire.frames import OBSERVATIONS_MAX, Camera
from pelorus.wire.layout import Floats

Indices = NDArray[np.intp]

ABSENT = -1.0  # all four numbers of a landmark that is not in the frame


def project(camera: Camera, q_C: Floats) -> Floats:
    """Projects points in the left camera (n, 3), m, depth > 0, to (n, 4) px: uL vL uR vR."""
    x, y, z = q_C.T
    v = camera.fy_px * y / z + camera.cy_px
    u_left = camera.fx_px * x / z + camera.cx_px
    return np.stack((u_left, v, camera.fx_px * (x - camera.baseline_m) / z + camera.cx_px, v), -1)


def point_jacobian(camera: Camera, q: Floats) -> Floats:
    """Returns d project / d q, (n, 4, 3)."""
    x, y, z = q.T
    D = np.zeros((len(q), 4, 3))
    D[:, 0, 0] = D[:, 2, 0] = camera.fx_px / z
    D[:, 1, 1] = D[:, 3, 1] = camera.fy_px / z
    D[:, 0, 2] = -camera.fx_px * x / z**2
    D[:, 2, 2] = -camera.fx_px * (x - camera.baseline_m) / z**2
    D[:, 1, 2] = D[:, 3, 2] = -camera.fy_px * y / z**2
    return D


def sum_by_frame(frame: Indices, count: int, values: Floats) -> Floats:
    """Returns sums (count, ...) of values (n, ...), which are sorted by frame."""
    counts = np.bincount(frame, minlength=count)
    out = np.zeros((count, *values.shape[1:]))
    if len(values):
        filled = counts > 0
        starts = np.concatenate(([0], np.cumsum(counts)[:-1]))
        out[filled] = np.add.reduceat(values, starts[filled], axis=0)
    return out


def triangulate(camera: Camera, pixels: Floats) -> Floats:
    """Maps (n, 4) px with positive disparity to points in the left camera (n, 3), m."""
    u_left, v_left, u_right, v_right = pixels.T
    scale = camera.baseline_m / (u_left - u_right)
    y = (0.5 * (v_left + v_right) - camera.cy_px) * scale * camera.fx_px / camera.fy_px
    return np.stack(((u_left - camera.cx_px) * scale, y, camera.fx_px * scale), -1)


class Pairs(NamedTuple):
    """Pairs of a landmark in frames k and k + lag: `first` and `second` are rows of Tracks."""

    frame: Indices  # k of each pair, ascending
    first: Indices
    second: Indices


@dataclass(frozen=True)
class Tracks:
    """Rows sorted by frame, then id: frame index, id, pixels (n, 4) in the order uL vL uR vR.

    `sigma_px` (n,) is of each of these pixels: 0 is the setting pixel-sigma, and None that of all.
    """

    frame_count: int
    frame: Indices
    id: NDArray[np.int64]
    pixels: Floats
    sigma_px: Floats | None = None

    @classmethod
    def none(cls, frame_count: int = 0) -> Tracks:
        """Returns those of so many frames that see nothing."""
        return cls(frame_count, np.empty(0, np.intp), np.empty(0, np.int64), np.empty((0, 4)))

    @classmethod
    def from_rows(
        cls,
        frame_count: int,
        frame: Indices,
        id: NDArray[np.int64],
        pixels: Floats,
        sigma_px: Floats | None = None,
    ) -> Tracks:
        return cls(frame_count, frame, id, pixels, sigma_px).at(np.lexsort((id, frame)))

    @classmethod
    def of_frames(
        cls,
        ids: Sequence[NDArray[np.integer[Any]]],
        pixels: Sequence[NDArray[np.floating[Any]]],
        sigmas_px: Sequence[NDArray[np.floating[Any]]] | None = None,
    ) -> Tracks:
        """Returns those of one frame or more: of each its ids (n,), pixels (n, 4), and sigmas."""
        frame = np.repeat(np.arange(len(ids)), [len(one) for one in ids])
        sigma_px = None if sigmas_px is None else np.concatenate(sigmas_px).astype(np.float64)
        numbers = np.concatenate(pixels).astype(np.float64)
        return cls.from_rows(
            len(ids), frame, np.concatenate(ids).astype(np.int64), numbers, sigma_px
        )

    def at(self, rows: Indices | NDArray[np.bool_]) -> Tracks:
        """Returns these rows, in this order."""
        sigma = None if self.sigma_px is None else self.sigma_px[rows]
        return Tracks(self.frame_count, self.frame[rows], self.id[rows], self.pixels[rows], sigma)

    @classmethod
    def from_dense(cls, features: Floats) -> Tracks:
        """Reads (4, M, T): M landmarks in T frames, -1 where absent; the id is the column."""
        seen = ~(features == ABSENT).all(axis=0)
        frame, id = np.nonzero(seen.T)
        return cls(features.shape[2], frame, id.astype(np.int64), features[:, id, frame].T)

    def __len__(self) -> int:
        return len(self.frame)

    def with_ids(self, id: NDArray[np.int64]) -> Tracks:
        tracks = replace(self, id=id)
        return tracks.at(np.lexsort((id, self.frame)))

    def counts(self) -> NDArray[np.int64]:
        """Returns the number of observations of each frame."""
        return np.bincount(self.frame, minlength=self.frame_count)

    def bounds(self) -> NDArray[np.int64]:
        """Returns bounds: frame k has the rows bounds[k] to bounds[k + 1]."""
        return np.concatenate(([0], np.cumsum(self.counts())))

    def pairs(self, lag: int) -> Pairs:
        """Returns all landmarks that are in frame k and, under the same id, in frame k + lag."""
        stride = np.int64(self.id.max() + 1) if len(self) else np.int64(1)
        key = self.frame * stride + self.id
        wanted = key + lag * stride
        at = np.searchsorted(key, wanted)
        found = (at < len(key)) & (key[np.minimum(at, len(key) - 1)] == wanted)
        first = np.nonzero(found)[0]
        return Pairs(self.frame[first], first, at[first])

    def twice(self) -> int | None:
        """Returns a row whose id stands in its frame a second time; None if there is none."""
        again = (np.diff(self.frame) == 0) & (np.diff(self.id) == 0)
        return int(again.argmax()) if again.any() else None

    def check(self, source: Path) -> None:
        """Refuses what no recording can hold."""
        if not len(self):
            raise ForeignFileError(source, "holds no observation at all")
        if not np.isfinite(self.pixels).all():
            row = int(np.nonzero(~np.isfinite(self.pixels).all(axis=1))[0][0])
            raise ForeignFileError(
                source,
                "a pixel is not finite",
                at=f"frame {self.frame[row]}, landmark {self.id[row]}",
            )
        fullest = int(self.counts().max())
        if fullest > OBSERVATIONS_MAX:
            raise ForeignFileError(
                source,
                f"a frame has {fullest} observations; at most {OBSERVATIONS_MAX} fit a STEREO "
                "frame",
            )
