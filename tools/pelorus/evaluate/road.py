# SPDX-License-Identifier: MIT
"""Distance of a trajectory to a digitised road, where no other reference exists.

The trajectory is levelled, that is projected on the plane of its two largest principal axes, and
fitted to the road by a rigid planar motion of fixed scale. The first metres are left out: the
road on the map may begin later.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from pelorus.errors import PelorusError
from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.program.console import progress
from pelorus.wire.layout import Floats

ROAD_STEP_M = 1.0  # spacing to which the road's points are interpolated
EVERY = 5  # one pose in five is compared
STARTS = 24  # headings from which the fit is tried, each mirrored too
EVALUATIONS_MAX = 60
POINTS_MIN = 10


@dataclass(frozen=True)
class RoadFigures:
    """RMS distance to the road, RMS distance out of the plane, tilt of the plane against z."""

    road_m: float
    out_of_plane_m: float
    tilt_deg: float


def read_road(path: Path) -> Floats:
    """Returns (n, 2), m: the last two columns of a CSV; lines with # in front are comments."""
    rows = foreign.rows(path)
    columns = len(rows[0].cells)
    if len(rows) < 2 or columns < 2:
        raise ForeignFileError(
            path,
            f"is no road: {len(rows)} rows of {columns} numbers; at least two rows arc_m,x_m,y_m "
            "are expected",
        )
    return foreign.numbers(path, rows)[:, -2:]


@dataclass(frozen=True)
class RoadFit:
    """The placement of a trajectory on the road: levelled, mirrored or not, turned, shifted."""

    figures: RoadFigures
    middle_m: Floats  # (3,)
    axes: Floats  # (2, 3): the trajectory's plane
    mirror: Floats  # (2,)
    turn_rad: float
    shift_m: Floats  # (2,)

    def place(self, points: Floats) -> Floats:
        """Maps points of the trajectory's world (n, 3) to the road's map (n, 2), m."""
        return _moved((points - self.middle_m) @ self.axes.T * self.mirror,
                      np.array([self.turn_rad, *self.shift_m]))  # fmt: skip


def compare(position: Floats, road: Floats, skip_m: float) -> RoadFigures:
    """Compares positions (n, 3), m, with the road (n, 2), m."""
    return fit(position, road, skip_m).figures


def fit(position: Floats, road: Floats, skip_m: float) -> RoadFit:
    """Returns the best fit of positions (n, 3), m, to the road (n, 2), m."""
    middle = position.mean(axis=0)
    centred = position - middle
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    plane = (centred @ axes[:2].T)[arc_length(position) > skip_m][::EVERY]
    if len(plane) < POINTS_MIN:
        raise PelorusError(
            f"the trajectory is {arc_length(position)[-1]:.1f} m long: too short to compare behind "
            f"the first {skip_m:g} m"
        )
    road_m, mirror, motion = _fit(plane, densified(road))
    found = RoadFigures(
        road_m=road_m,
        out_of_plane_m=float(np.sqrt(np.mean((centred @ axes[2]) ** 2))),
        tilt_deg=float(np.degrees(np.arccos(min(1.0, abs(axes[2][2]))))),
    )
    return RoadFit(found, middle, axes[:2], mirror, float(motion[0]), motion[1:])


def arc_length(points: Floats) -> Floats:
    """Returns (n,) the distance along the points from the first one, m."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate(([0.0], np.cumsum(steps)))


def densified(road: Floats) -> Floats:
    """Returns the road with a point every ROAD_STEP_M."""
    arc = arc_length(road)
    at = np.arange(0, arc[-1], ROAD_STEP_M)
    return np.stack([np.interp(at, arc, road[:, axis]) for axis in range(2)], axis=-1)


def _moved(points: Floats, motion: Floats) -> Floats:
    """Returns (n, 2) turned by motion[0] and shifted by the rest."""
    c, s = np.cos(motion[0]), np.sin(motion[0])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + motion[1:])


def _fit(points: Floats, road: Floats) -> tuple[float, Floats, Floats]:
    """Returns the least RMS distance over planar motions and mirrors, and these.

    Mirrors count, for principal axes have no sign.
    """
    nearest = scipy.spatial.cKDTree(road)

    def distance(x: Floats, mirror: Floats) -> Floats:
        return np.asarray(nearest.query(_moved(points * mirror, x))[0])

    headings = np.arange(STARTS) * 2 * np.pi / STARTS
    tries = [(heading, sign) for sign in (1.0, -1.0) for heading in headings]
    best: tuple[float, Floats, Floats] = (np.inf, np.ones(2), np.zeros(3))
    for heading, sign in progress(tries, "fitting to the road"):
        start = np.concatenate(([heading], road.mean(axis=0)))
        mirror = np.array([1.0, sign])
        found = scipy.optimize.least_squares(
            distance, start, args=(mirror,), max_nfev=EVALUATIONS_MAX
        )
        rms = float(np.sqrt(np.mean(found.fun**2)))
        if rms < best[0]:
            best = (rms, mirror, np.asarray(found.x))
    return best
