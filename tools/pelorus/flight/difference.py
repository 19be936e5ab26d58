# SPDX-License-Identifier: MIT
"""The differences between two answers to one frame."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from pelorus.flight.log import Frame
from pelorus.wire.frames import Pose, Report
from pelorus.wire.layout import Floats

POSE_WORDS = {
    "t_ns": "time",
    "p_WB_m": "position",
    "R_WB": "rotation",
    "covariance": "covariance",
    "v_B_mps": "velocity",
    "w_B_radps": "rate",
    "bias": "bias",
    "velocity_covariance": "covariance of velocity and rate",
    "real_bytes": "bytes of a real",
    "reset_count": "reset count",
}
NOT_COMPARED = ("t_ns", "subject", "update_us")  # the key, and the robot's own clock
DIAGONAL = [i * (i + 3) // 2 for i in range(6)]


@dataclass(frozen=True)
class PoseDistance:
    """Distances between two poses."""

    position_m: float = 0.0
    angle_deg: float = 0.0
    covariance: float = 0.0  # largest |dP_ij| over the desk's sigma_i sigma_j


@dataclass(frozen=True)
class Difference:
    """Differences between one frame's answers; if none is listed, all common bits are equal."""

    robot: Frame
    desk: Frame
    pose: list[str] = field(default_factory=list)  # fields of POSE with other bits
    report: dict[str, tuple[float, float]] = field(default_factory=dict)  # name: desk, robot
    missing: str = ""  # what the log lacks of the answer
    sizes: PoseDistance = PoseDistance()

    @property
    def same(self) -> bool:
        return not self.pose and not self.report


def differ(robot: Frame, desk: Frame) -> Difference:
    """Compares bit by bit what both have; an answer is a REPORT, with a POSE if it was accepted."""
    found = Difference(robot, desk)
    if robot.report is not None and desk.report is not None:
        found = replace(found, report=_reports(robot.report, desk.report))
    if robot.pose is not None and desk.pose is not None:
        words, sizes = _poses(robot.pose, desk.pose)
        return replace(found, pose=words, sizes=sizes, missing=_missing(robot, desk))
    if robot.pose is not None:
        found = replace(found, pose=["the desk gives no pose"])
    return replace(found, missing=_missing(robot, desk))


def _missing(robot: Frame, desk: Frame) -> str:
    lacking = [
        name
        for name, ours, theirs in (
            ("POSE", desk.pose, robot.pose),
            ("REPORT", desk.report, robot.report),
        )
        if ours is not None and theirs is None
    ]
    return " and ".join(lacking)


def _reports(robot: Report, desk: Report) -> dict[str, tuple[float, float]]:
    pairs = {
        name: (getattr(desk, name), getattr(robot, name))
        for name in (f.name for f in fields(Report))
        if name not in NOT_COMPARED
    }
    return {name: pair for name, pair in pairs.items() if _bits(pair[0]) != _bits(pair[1])}


def _poses(robot: Pose, desk: Pose) -> tuple[list[str], PoseDistance]:
    if robot == desk:
        return [], PoseDistance()
    words = [
        word
        for name, word in POSE_WORDS.items()
        if _bits(getattr(robot, name)) != _bits(getattr(desk, name))
    ]
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        sizes = PoseDistance(
            _finite(float(np.linalg.norm(robot.p_WB_m - desk.p_WB_m))),
            _finite(_angle_deg(desk.R_WB.T @ robot.R_WB)),
            _finite(_covariance(robot.covariance, desk.covariance)),
        )
    return words or ["its bytes"], sizes


def _bits(value: object) -> bytes:
    return value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()


def _angle_deg(R: Floats) -> float:
    """Returns the angle by the skew part: the trace would amplify float32's rounding."""
    s = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.degrees(np.arctan2(s, np.trace(R) - 1)))


def _covariance(robot: Floats, desk: Floats) -> float:
    row, column = np.tril_indices(6)
    sigma = np.sqrt(desk[DIAGONAL])
    scale = sigma[row] * sigma[column]
    change = np.abs(robot - desk)
    return float(np.max(np.where(change > 0, change / scale, 0.0)))


def _finite(size: float) -> float:
    return size if np.isfinite(size) else float("inf")
