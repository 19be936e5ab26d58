# SPDX-License-Identifier: MIT
"""Finds a robot's pose at the start of its drive from positions in axes of the earth.

A filter's world begins with the robot; positions east and north are of no use to it until the
heading is known. The path by the twists alone, on level ground, is turned and moved until it fits
the positions. The path must be long enough for the heading, and short enough for small drift.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.io.small_sensors import POSITION
from pelorus.math import motion
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, Reading, Start, StartFlag
from pelorus.wire.layout import Floats, pack_symmetric

LEVEL = {
    BodyAxes.FORWARD_LEFT_UP: np.eye(3),
    BodyAxes.FORWARD_RIGHT_DOWN: np.diag([1.0, -1.0, -1.0]),
}
TILT_SIGMA_RAD = 0.1  # of the ground on which a robot stands
YAW_KNOWN_RAD = 0.02  # sufficient sigma of the heading: the path is long enough
YAW_MOST_RAD = 0.3  # with a larger sigma there is no START
SUBJECT = "heading at the start"


def started(recording: Recording) -> tuple[Recording, Finding]:
    """Returns the recording with a START in its positions' axes, if its twists determine one."""
    readings = [m for m in recording.readings if m.sensor == POSITION.number and m.axes & 3 == 3]
    level = LEVEL.get(recording.header.body_axes)
    if not len(recording.twist_t_ns):
        return recording, _untold("no twists are there, and an IMU does not tell where north is")
    if level is None or len(readings) < 3:
        return recording, _untold(
            "twists, and body axes forward-left-up or forward-right-down, tell it"
        )
    way, seen, sigma = _ways(recording, readings, level)
    for count in range(3, len(readings) + 1):
        a, b = way[:count] - way[:count].mean(axis=0), seen[:count] - seen[:count].mean(axis=0)
        spread = float(np.sum(a[:, :2] ** 2))
        dot, cross = np.sum(a[:, :2] * b[:, :2]), np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        yaw = float(np.arctan2(cross, dot))
        left = b[:, :2] - a[:, :2] @ _about_z(yaw)[:2, :2].T
        noise = max(sigma, float(np.sqrt(np.sum(left**2) / (2 * count - 3))))
        known = noise / np.sqrt(spread) if spread > 0 else np.inf
        if known < YAW_KNOWN_RAD:
            break
    if known > YAW_MOST_RAD:
        return recording, _untold(f"the way is too short: it is known to {known:.2g} rad")
    R_yaw = _about_z(yaw)
    place = seen[:count].mean(axis=0) - R_yaw @ way[:count].mean(axis=0)
    about = np.array([TILT_SIGMA_RAD, TILT_SIGMA_RAD, known])
    variance = np.concatenate((np.full(3, noise**2 / count + sigma**2 / count), about**2))
    t_ns = int(recording.twist_t_ns[0])
    start = Start(
        t_ns, R_yaw @ level, place, StartFlag.COVARIANCE, pack_symmetric(np.diag(variance))
    )
    finding = Finding(
        SUBJECT,
        False,
        f"{np.degrees(yaw):.1f} +- {np.degrees(known):.1f} degrees from east to north, of {count} "
        f"positions over {np.sqrt(spread / count):.3g} m",
        "START says so; another one is given by a truth, or --start identity",
        measured=True,
    )
    return replace(recording, start=start), finding


def _ways(
    recording: Recording, readings: list[Reading], level: Floats
) -> tuple[Floats, Floats, float]:
    """Returns two paths (n, 3) of the sensor, and the readings' sigma.

    The first is by the twists, in level axes of the first body; the second is as the sensor read
    it, up to the arm's turn.
    """
    t_ns = np.array([m.t_ns for m in readings], np.int64)
    body: Poses = motion.path_at(
        t_ns,
        recording.twist_t_ns,
        recording.v_B_mps,
        recording.w_B_radps,
        recording.header.twist_timing,
    )
    arms = np.array([m.at_B_m for m in readings])
    way = (body.p + np.einsum("nij,nj->ni", body.R, arms)) @ level.T
    seen = np.array([m.value for m in readings])
    seen[:, 2] = np.where([m.axes & 4 for m in readings], seen[:, 2], way[:, 2])
    return way, seen, float(np.median([m.sigma[:2].max() for m in readings]))


def _about_z(yaw: float) -> Floats:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def _untold(why: str) -> Finding:
    return Finding(
        SUBJECT,
        False,
        why,
        "positions are used only if the start's place and heading are given in their axes: by a "
        "truth (--truth), or by START",
        is_conclusive=False,
    )
