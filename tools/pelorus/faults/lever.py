# SPDX-License-Identifier: MIT
"""Detects an extrinsic whose translation is the camera's position in the body instead of t_CB.

A matrix [R | p_BC] looks like an extrinsic; right is [R | -R p_BC]. Turns show it: with the turn
R_C and the displacement p_C of the camera over some frames, and that of the body by the twists,

    p_C = (I - R_C) t_CB + R_CB p_back          (coordinates in camera k -> camera k + lag)

R_C and p_C come from the images alone, since a gyro may be noisy or biased. Along the line from t
(s = 0) to -R t (s = 1), s is the first unknown of a robust regression over all frames; five more
cover what else moves p_C in a turn: twists that come late, a scale of the way, and three small
angles of the mounting. Remedy where s is significantly nearer to 1: t_CB = -R t.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.finding import Finding
from pelorus.faults.likelihood import of_estimate, with_ratio
from pelorus.io.recording import Recording
from pelorus.math.se3 import Poses
from pelorus.tracking import visual_motion
from pelorus.tracking.visual_motion import PAIRS_MIN, SeenPairs, seen_pairs
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

SUBJECT = "lever of the extrinsic"
LAG = 3
SIGMAS_MIN = 3.0  # standard deviations by which s must exceed one half
# and by so much: cars slip, and their velocities are not quite those of one point
MARGIN_MIN = 0.08
SEPARATED_MIN_M = 0.03  # hypotheses that never differ more cannot be separated
REWEIGHTINGS = 20
RIDGE = 1e-9  # keeps a column that the drive does not excite solvable


def mend(recording: Recording) -> tuple[Recording, Finding]:
    """Replaces t by -R t if the turns show that it is needed."""
    camera = recording.header.camera
    given = recording.T_CB
    other = Poses(given.R, -given.R @ given.p)
    seen = seen_pairs(recording.tracks, camera, LAG)
    usable = seen.counts() >= PAIRS_MIN
    seen_motion = visual_motion.estimate(seen, camera)
    apart = (np.eye(3) - seen_motion.R) @ (other.p - given.p)
    distance = np.linalg.norm(apart, axis=1)
    turning = usable & (distance > SEPARATED_MIN_M)
    if turning.sum() < PAIRS_MIN:
        evidence = (
            f"{int(turning.sum())} frames with a turn that would tell, {PAIRS_MIN} are expected"
        )
        return recording, Finding(SUBJECT, False, evidence, "left as given", is_conclusive=False)
    way = _way(recording, seen_motion.R, given)
    columns = _columns(recording, seen_motion.R, way, apart)
    s, sigma = _regress(seen_motion.p[usable] - way[usable], columns[usable])
    errors = [
        _reprojection(recording, seen, Poses(seen_motion.R, way_), turning)
        for way_ in (way, way + apart)
    ]
    evidence = (
        f"between [R | t] (0) and [R | -R t] (1) the data say {s:.2f} +- {sigma:.2f}; lag-{LAG} "
        f"reprojection in {int(turning.sum())} turning frames is {errors[0]:.1f} and "
        f"{errors[1]:.1f} px"
    )
    evidence = with_ratio(evidence, of_estimate(s, 0.0, 1.0, sigma))
    if s - 0.5 < max(SIGMAS_MIN * sigma, MARGIN_MIN):
        return recording, Finding(SUBJECT, False, evidence, "nothing to mend")
    action = f"t_CB {_metres(given.p)} replaced by {_metres(other.p)}"
    return recording.with_extrinsic(other), Finding(SUBJECT, True, evidence, action)


def _way(recording: Recording, R_C: Floats, T_CB: Poses) -> Floats:
    """Returns p_C of each k from the images' turn, the twists' displacement and this lever."""
    return np.asarray(T_CB.p - R_C @ T_CB.p + recording.body_motion(LAG).p @ T_CB.R.T)


def _columns(recording: Recording, R_C: Floats, way: Floats, apart: Floats) -> Floats:
    """Returns (frames, 3, 6) the derivatives of p_C by s and by the other unknowns."""
    T_CB = recording.T_CB
    early, late = (
        _way(recording.with_header(twist_timing=timing), R_C, T_CB)
        for timing in (TwistTiming.START, TwistTiming.END)
    )
    driven = way - (T_CB.p - R_C @ T_CB.p)
    tilts = [np.cross(axis, driven) for axis in np.eye(3)]
    return np.stack((apart, late - early, driven, *tilts), axis=-1)


def _regress(offset: Floats, columns: Floats) -> tuple[float, float]:
    """Returns x_0 of offset = columns x + noise, and its standard deviation.

    Weights as of Geman and McClure; the windows overlap LAG-fold, so the variance is LAG times
    that of independent ones.
    """
    leverage = np.sum(columns[:, :, 0] ** 2, axis=1)
    strong = leverage >= np.median(leverage)
    weight = np.ones(len(offset))
    for _ in range(REWEIGHTINGS):
        H = np.einsum("nai,naj,n->ij", columns, columns, weight) + RIDGE * np.eye(6)
        x = np.linalg.solve(H, np.einsum("nai,na,n->i", columns, offset, weight))
        residual = offset - columns @ x
        squared = np.sum(residual**2, axis=1)
        weight = 1 / (1 + squared / (np.median(squared[strong]) + 1e-12)) ** 2
    score = np.einsum("nai,na,n->ni", columns, residual, weight)
    covariance = LAG * np.linalg.solve(H, np.linalg.solve(H, score.T @ score).T)
    return float(x[0]), float(np.sqrt(covariance[0, 0]))


def _reprojection(
    recording: Recording, seen: SeenPairs, motion: Poses, turning: NDArray[np.bool_]
) -> float:
    errors = seen.reproject(recording.header.camera, motion)
    return float(np.median(errors[turning[seen.frame]]))


def _metres(p: Floats) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in p) + ") m"
