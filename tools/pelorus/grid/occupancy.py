# SPDX-License-Identifier: MIT
"""A 2-D occupancy grid from landmarks and the rays to them.

A ray from the camera to a landmark passes through free space; where the landmark is, something
stands. Both are weighted by the landmark's covariance:

- a cell on the ray, at the distance r from the camera, gets FREE times the probability that the
  landmark lies behind it, Phi((d - MARGIN sigma - r) / sigma), d its distance and sigma its
  standard deviation along the ray. A landmark of doubtful depth frees little before it;
- a landmark gives OCCUPIED in all, spread over the cells as its own Gaussian is: one that is
  certain to a cell marks that cell, one that is not marks none.

Log-odds of a cell: what stands there, at most OCCUPIED, minus what was seen through it, at most
FREE_MOST. So a ray that passes above a landmark never takes it away: a robot had better believe in
one wall too many. Rays and landmarks count inside a band of height about the body alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.grid import plane
from pelorus.grid.plane import Plane
from pelorus.grid.sightings import Sightings
from pelorus.io.tracks import Indices
from pelorus.program.console import progress
from pelorus.wire.frames import BodyAxes
from pelorus.wire.layout import Floats

FREE, FREE_MOST = 0.45, 2.0
OCCUPIED = 8.0
MARGIN = 2.0  # standard deviations before the landmark at which its ray ends
SEEN_LEAST = 3  # a landmark seen less often may be a mismatch
DEPTH_SIGMA_MOST = 0.5  # of its distance: a less certain landmark is left out
UP_OVER_FRAMES = 50  # on either side, for the mean of the body's up

CELLS_MOST = 25_000_000
RESOLUTIONS_M = (0.05, 0.1, 0.2, 0.5, 1.0)
BORDER = 0.03  # of the longer side, and at least BORDER_CELLS
BORDER_CELLS = 4
CELLS_AT_ONCE = 1_000_000
FAINT = 0.01  # of a landmark in its likeliest cell: a smaller share marks nothing


class Band(NamedTuple):
    """Heights above the body's origin, m."""

    low_m: float
    high_m: float


EVERYTHING = Band(-np.inf, np.inf)
CAR = Band(-0.3, 4.0)  # from above the road to below the trees' crowns


@dataclass(frozen=True)
class Wish:
    """The user's choices; None: chosen by the data."""

    resolution_m: float | None = None
    band: Band | None = None
    range_m: float = 50.0


@dataclass(frozen=True)
class Grid:
    """`log_odds` (height, width), row 0 the lowest; (x, y) are the plane's (right, up).

    `origin_m` is the outer corner of the cell [0, 0].
    """

    log_odds: Floats
    resolution_m: float
    origin_m: tuple[float, float]
    plane: Plane
    band: Band
    path_m: Floats  # (n, 2): the body's path
    landmarks: int  # in the grid

    @property
    def probability(self) -> Floats:
        return np.asarray(scipy.special.expit(self.log_odds))


def occupancy(seen: Sightings, wish: Wish) -> Grid:
    """Builds the grid; raises PelorusError where it would be empty or absurdly large."""
    looked_at = plane.choose_for_map(seen.body_axes, seen.poses, seen.landmarks_W)
    band = wish.band or (EVERYTHING if seen.body_axes == BodyAxes.OTHER else CAR)
    up = _up(seen, looked_at)
    last = seen.last_frame
    height = np.sum((seen.landmarks_W - seen.poses.p[last]) * up[last], axis=1)
    way = looked_at.flat(seen.landmarks_W - seen.camera_W[last])
    distance = np.linalg.norm(way, axis=1)
    spread = _flat_covariance(seen.spread, looked_at)
    sigma = _along(spread, way / np.maximum(distance, 1e-9)[:, None])
    sure = (seen.times_seen >= SEEN_LEAST) & (sigma < DEPTH_SIGMA_MOST * distance)
    stands = sure & (height >= band.low_m) & (height <= band.high_m) & (distance <= wish.range_m)
    if not stands.any():
        raise PelorusError(
            f"{seen.path}: none of its {len(stands)} landmarks stands in the map: "
            f"{np.sum(~sure)} are too uncertain or were seen less than {SEEN_LEAST} times, the "
            f"others lie outside {band.low_m:g} to {band.high_m:g} m about the body or beyond "
            f"{wish.range_m:g} m; widen --height or --range"
        )
    path = looked_at.flat(seen.poses.p)
    points = looked_at.flat(seen.landmarks_W)
    shown = np.concatenate((path, points[stands]))
    resolution = wish.resolution_m or _resolution(spread[stands], shown)
    sheet = _Sheet.around(seen, shown, resolution)
    free = _free(sheet, seen, _Rays(looked_at, up, points, spread, sure, band), wish.range_m)
    occupied = _occupied(sheet, points[stands], spread[stands])
    log_odds = np.minimum(occupied, OCCUPIED) - np.minimum(free, FREE_MOST)
    origin = (float(sheet.low[0]), float(sheet.low[1]))
    return Grid(log_odds, resolution, origin, looked_at, band, path, int(stands.sum()))


def _up(seen: Sightings, looked_at: Plane) -> Floats:
    """Returns (n, 3) the upward direction in the world at each frame.

    It is the body's own, as a mean over some frames: the world of a long drive does not stay level
    (no sensor here measures gravity), and the body pitches. Where the body has no up, it is the
    viewer's direction.
    """
    if seen.body_axes == BodyAxes.OTHER:
        right, up = (axis.sign * np.eye(3)[axis.number] for axis in looked_at[:2])
        return np.tile(np.cross(right, up), (len(seen.t_ns), 1))
    sign = 1.0 if seen.body_axes == BodyAxes.FORWARD_LEFT_UP else -1.0
    sums = np.concatenate((np.zeros((1, 3)), np.cumsum(sign * seen.poses.R[:, :, 2], axis=0)))
    k = np.arange(len(seen.t_ns))
    first = np.maximum(k - UP_OVER_FRAMES, 0)
    behind = np.minimum(k + UP_OVER_FRAMES + 1, len(k))
    mean = sums[behind] - sums[first]
    return np.asarray(mean / np.linalg.norm(mean, axis=1)[:, None])


def _flat_covariance(spread: Floats, looked_at: Plane) -> Floats:
    """Projects covariances: (m, 3, 3) -> (m, 2, 2)."""
    pick = np.zeros((2, 3))
    for row, axis in enumerate(looked_at[:2]):
        pick[row, axis.number] = axis.sign
    return np.asarray(pick @ spread @ pick.T)


def _along(covariance: Floats, direction: Floats) -> Floats:
    """Returns the standard deviation along unit vectors."""
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", direction, covariance, direction)))


def _resolution(spread: Floats, points: Floats) -> float:
    """Returns a cell size as fine as half of the landmarks and the drive's length allow."""
    sigma = float(np.median(np.sqrt(np.linalg.eigvalsh(spread)[:, 1])))
    fine = (step for step in RESOLUTIONS_M if step >= sigma)
    return next((step for step in fine if _cells(points, step) <= CELLS_MOST), RESOLUTIONS_M[-1])


def _extent(points: Floats, step: float) -> tuple[Floats, Floats]:
    """Returns the sheet's lower corner, and its width and height in cells."""
    low, high = points.min(axis=0), points.max(axis=0)
    border = max(BORDER * float((high - low).max()), BORDER_CELLS * step)
    low = np.floor((low - border) / step) * step
    return low, np.ceil((high + border - low) / step)


def _cells(points: Floats, step: float) -> float:
    return float(np.prod(_extent(points, step)[1]))


class _Sheet(NamedTuple):
    """The cells' places: `low` is the outer corner of [0, 0], `size` (width, height)."""

    low: Floats
    size: tuple[int, int]
    step: float

    @classmethod
    def around(cls, seen: Sightings, points: Floats, step: float) -> _Sheet:
        low, (width, height) = _extent(points, step)
        if width * height > CELLS_MOST:
            coarser = step * np.sqrt(width * height / CELLS_MOST)
            raise PelorusError(
                f"{seen.path}: a map of {width:.0f} x {height:.0f} cells of {step:g} m is more "
                f"than the {CELLS_MOST} cells that are allowed; take --resolution "
                f"{_rounded_up(coarser):g} or coarser"
            )
        return cls(low, (int(width), int(height)), step)

    def cells(self, points: Floats) -> Indices:
        return np.asarray(np.floor((points - self.low) / self.step).astype(np.intp))

    def add(self, sheet: Floats, cells: Indices, amount: Floats) -> None:
        """Adds amounts (n,) to cells (n, 2) of the flat sheet; cells outside are left out."""
        inside = ((cells >= 0) & (cells < self.size)).all(axis=-1)
        number = cells[inside] @ np.array([1, self.size[0]])
        sheet += np.bincount(number, amount[inside], minlength=len(sheet))

    def empty(self) -> Floats:
        return np.zeros(self.size[0] * self.size[1])

    def shaped(self, sheet: Floats) -> Floats:
        return sheet.reshape(self.size[1], self.size[0])


def _rounded_up(x: float) -> float:
    """Rounds up to two digits."""
    digits = 10 ** (np.floor(np.log10(x)) - 1)
    return float(np.ceil(x / digits) * digits)


class _Rays(NamedTuple):
    """The landmarks' values that rays need."""

    looked_at: Plane
    up: Floats
    points: Floats
    spread: Floats
    sure: NDArray[np.bool_]
    band: Band


def _free(sheet: _Sheet, seen: Sightings, rays: _Rays, range_m: float) -> Floats:
    """Returns the log-odds that the rays add to each cell."""
    eyes = rays.looked_at.flat(seen.camera_W)
    frame, landmark = _once(sheet, seen, eyes, rays.sure)
    way = rays.points[landmark] - eyes[frame]
    length = np.linalg.norm(way, axis=1)
    ahead = way / np.maximum(length, 1e-9)[:, None]
    sigma = _along(rays.spread[landmark], ahead)
    eye_height, point_height = (
        np.sum((W - seen.poses.p[frame]) * rays.up[frame], axis=1)
        for W in (seen.camera_W[frame], seen.landmarks_W[landmark])
    )
    climb = (point_height - eye_height) / np.maximum(length, 1e-9)
    reach = np.minimum(length, range_m)
    out = sheet.empty()
    order = np.argsort(reach, kind="stable")  # rays of similar length share an array
    each = max(1, int(CELLS_AT_ONCE * sheet.step / max(range_m, sheet.step)))
    starts = range(0, len(order), each)
    for part in progress((order[k : k + each] for k in starts), "following rays", len(starts)):
        r = np.arange(0.5, reach[part].max() / sheet.step + 0.5) * sheet.step
        behind = length[part] - MARGIN * sigma[part]
        blur = np.maximum(sigma[part], 0.5 * sheet.step)
        weight = FREE * scipy.special.ndtr((behind[:, None] - r) / blur[:, None])
        height = eye_height[part, None] + climb[part, None] * r
        counts = (height >= rays.band.low_m) & (height <= rays.band.high_m)
        counts &= r <= reach[part, None]
        at = eyes[frame[part], None] + ahead[part, None] * r[:, None]
        sheet.add(out, sheet.cells(at[counts]), weight[counts])
    return sheet.shaped(out)


def _once(
    sheet: _Sheet, seen: Sightings, eyes: Floats, sure: NDArray[np.bool_]
) -> tuple[Indices, Indices]:
    """Returns one sighting for each pair of a landmark and the camera's cell.

    Looking again at the same point from the same place shows nothing new.
    """
    good = sure[seen.landmark]
    frame, landmark = seen.frame[good], seen.landmark[good]
    place = sheet.cells(eyes[frame])
    _, first = np.unique(np.column_stack((landmark, place)), axis=0, return_index=True)
    return frame[first], landmark[first]


def _occupied(sheet: _Sheet, points: Floats, spread: Floats) -> Floats:
    """Returns the log-odds that the landmarks add to each cell.

    Each counts as in the middle of its cell, so that a certain one marks one cell and not two by
    halves. The variance of a place inside a cell, step^2 / 12, is added to its own.
    """
    out = sheet.empty()
    likeliest = sheet.step**2 / (2 * np.pi * np.sqrt(np.linalg.det(spread)))
    points, spread = points[likeliest > FAINT], spread[likeliest > FAINT]
    inverse = np.linalg.inv(spread + np.eye(2) * sheet.step**2 / 12)
    middle = sheet.cells(points)
    widest = np.sqrt(np.linalg.eigvalsh(spread)[:, 1])
    extent = np.ceil(3 * widest / sheet.step).astype(int) + 1
    for reach in np.unique(extent).tolist():
        same = np.nonzero(extent == reach)[0]
        around = np.arange(-reach, reach + 1)
        offset = np.stack(np.meshgrid(around, around), axis=-1).reshape(-1, 2)
        each = max(1, CELLS_AT_ONCE // len(offset))
        for part in (same[k : k + each] for k in range(0, len(same), each)):
            d = offset * sheet.step
            weight = np.exp(-0.5 * np.einsum("ci,nij,cj->nc", d, inverse[part], d))
            weight *= OCCUPIED / weight.sum(axis=1, keepdims=True)
            cells = (middle[part, None] + offset).reshape(-1, 2)
            sheet.add(out, cells, weight.reshape(-1))
    return sheet.shaped(out)
