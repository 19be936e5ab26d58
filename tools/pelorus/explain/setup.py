# SPDX-License-Identifier: MIT
"""Finds what is wrong throughout: settings that do not fit, a front end that loses its tracks.

It is no event. But a filter whose sigmas are wrong rejects, doubts and locks, and the reader of its
log must know that first.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pelorus.explain.inputs import is_habit, losses
from pelorus.explain.log import NO_READING, FilterLog, Flags, period
from pelorus.wire.schema import STATUSES, number

MISFIT, BIAS_OFF, CONTRADICTED, NO_READINGS = (
    number("reason", name)
    for name in ("NOISE_MISFIT", "BIAS_OFF_PRIOR", "TWIST_CONTRADICTED", "NO_TWISTS")
)
LATE = number("status", "LATE")
GATED_MOST = 0.2  # of the matches: with right sigmas the gate rejects one of a hundred
FRAMES_LEAST = 20  # for such a remark
ALL_ALONG = 0.5  # of the frames
DOMINATES = 2.0  # ratio from which one part of a vector is most of it
PERIODS_LATE = 2.0  # behind a frame; its newest reading is normally within one
DIRECTIONS = ("forward", "sideways", "upward", "roll", "pitch", "yaw")


def of_setup(log: FilterLog, calm: Flags) -> Iterator[str]:
    """Yields remarks; `calm` are the frames to judge by: those before the first event."""
    if np.count_nonzero(calm) < FRAMES_LEAST:
        return
    if np.mean(log.column("status")[calm] != 0) > ALL_ALONG:
        yield refusals(log)
    yield from (gate := list(_gate(log, calm)))
    yield from _noise(log, calm, bool(gate))
    if _share(log, NO_READINGS, calm) > ALL_ALONG:
        yield _readings(log, calm)
    if _share(log, BIAS_OFF, calm) > ALL_ALONG:
        yield _bias(log, calm)
    lost = losses(log)
    if lost and is_habit(log, lost, 0):
        whole_s = float(np.ptp(log.t_ns)) * 1e-9
        yield f"the front end loses all tracks every {whole_s / len(lost):.1f} s, and begins anew"


def refusals(log: FilterLog) -> str:
    """Returns a remark on refused frames; empty where there are none."""
    status = log.column("status")
    refused = status != 0
    if not refused.any():
        return ""
    number_of = int(np.bincount(-status[refused]).argmax())
    words = f"{np.count_nonzero(refused)} of {len(status)} frames were refused: "
    behind_ns = (log.behind_ns - log.t_ns)[refused & (log.behind_ns != NO_READING)]
    if -number_of == LATE and len(behind_ns) and (late_ns := behind_ns.max()) > 0:
        name = "IMU readings" if log.by_imu else "twists"
        return (
            f"{words}they come after {name} that are newer by up to {late_ns * 1e-9:.3f} s: set "
            "twist-delay to that or more, or correct the camera's stamps"
        )
    return words + STATUSES.get(-number_of, f"status {-number_of}")


def _share(log: FilterLog, bits: int, calm: Flags) -> float:
    return float(log.said(bits)[calm].mean())


def _noise(log: FilterLog, calm: Flags, gate_told: bool) -> Iterator[str]:
    if log.said(MISFIT)[calm].any():
        last = [e for e, c in zip(log.evidence, calm, strict=True) if c and e is not None]
        usual = np.sqrt(last[-1].usual) if last else np.ones(6)
        worst = int(np.argmax(usual))
        names = "the IMU's noises" if log.by_imu else "velocity-sigma or gyro-sigma"
        yield (
            f"pictures and odometry differ all along by {usual[worst]:.1f} times their sigmas "
            f"({DIRECTIONS[worst]}): {names} too small, or the calibration is off"
        )
    elif not gate_told and _share(log, CONTRADICTED, calm) > GATED_MOST:
        yield (
            f"pictures and odometry disagree in {_share(log, CONTRADICTED, calm):.0%} of the "
            "frames and no one moment shows why: settings, calibration or clocks; `pelorus check`"
        )


def _bias(log: FilterLog, calm: Flags) -> str:
    """Returns a remark on wheels' bias: along the way by a scale, across it by a turned camera."""
    poses = [pose for pose, good in zip(log.poses, calm, strict=True) if good and pose is not None]
    v, b = np.zeros(3), np.zeros(6)
    if poses and len(log.readings) and not log.by_imu and log.bias_sigma.all():
        v, b = log.readings[:, :3].mean(axis=0), np.asarray(poses[-1].bias, np.float64)
    speed = float(np.linalg.norm(v))
    off = np.linalg.norm(
        (b / np.where(log.bias_sigma > 0, log.bias_sigma, 1)).reshape(2, 3), axis=1
    )
    if speed and off[0] > off[1]:
        along = abs(float(b[:3] @ v)) / speed
        across = float(np.linalg.norm(b[:3] - (b[:3] @ v) / speed**2 * v))
        told = f"the velocity's bias is far from its prior, {np.linalg.norm(b[:3]):.2f} m/s mostly"
        if along > DOMINATES * across:
            return (
                f"{told} along the way at {speed:.1f} m/s, as a wrong scale makes it: baseline, "
                "focal length, or the wheels' radius"
            )
        if across > DOMINATES * along:
            return (
                f"{told} across the way at {speed:.1f} m/s, as a camera makes it that is turned on "
                "the body: R_CB"
            )
    return (
        "a bias is far from its prior: do pictures and odometry disagree in scale or direction, or "
        "is bias-velocity-sigma or bias-gyro-sigma too small?"
    )


def _readings(log: FilterLog, calm: Flags) -> str:
    """Returns a remark on readings that are missing, refused, or behind the frames."""
    name = "IMU readings" if log.by_imu else "twists"
    behind = log.behind_ns[calm & (log.behind_ns != NO_READING)]
    if not len(behind):
        return f"there are no {name}: pictures alone move the body"
    late_s = float(np.median(log.t_ns[calm & (log.behind_ns != NO_READING)] - behind)) * 1e-9
    refused = f"{len(log.refused)} messages of {len(log.reading_ns)} {name} were refused"
    if late_s * 1e9 > PERIODS_LATE * period(log.reading_ns):
        return (
            f"the {name} come {late_s:.3f} s later than the frames, and {refused}: set twist-delay "
            "to that or more, or correct the stamps"
        )
    return f"{name} are missing, refused or too old all along: {refused}"


def gated_share(log: FilterLog, calm: Flags) -> float:
    """Returns the share of all matches that the gate rejected."""
    matched, gated = (int(log.column(name)[calm].sum()) for name in ("matched", "gated"))
    return gated / matched if matched else 0.0


def _gate(log: FilterLog, calm: Flags) -> Iterator[str]:
    if (share := gated_share(log, calm)) > GATED_MOST:
        yield (
            f"the gate rejects {share:.0%} of the matches: pixel-sigma too small, wrong "
            "tracks, or a wrong calibration; `pelorus check`"
        )
