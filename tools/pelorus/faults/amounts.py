# SPDX-License-Identifier: MIT
"""Reports lever, scale and clock in words where they are significantly off and it matters."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.agreement import Agreement
from pelorus.faults.fault import Fault
from pelorus.io.recording import Recording
from pelorus.math.se3 import Poses
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

SCALE_SIGMAS, SCALE_OFF, SCALE_WILD = 4.0, 0.015, 0.15
# Used where the HEADER has no bias. With the filter's own default, which is smaller, 7 of 38 good
# drives with biases of 0.01 and 0.03 m/s would be called faulty.
BIAS_MPS, BIAS_SIGMAS = 0.03, 3.0
SCALE_KNOWN = 10.0  # sigmas from zero: a wild scale known no better is none
CLOCK_SIGMAS, CLOCK_OFF_S = 4.0, 0.015
LEVER_APART, LEVER_SURE = 4.0, 16.0  # sigmas between the two places; -2 ln of the likelihood ratio
PLACE_SURE, PLACE_OFF_M = 36.0, 0.05
PLACE_TOLD_M = 10.0  # sigma above which a place is not reported
LEVER_SHARE = 0.05  # relative sigma of the place as it was measured
# A turning car slips sideways by this times v^2 w, and its camera seems to be elsewhere.
SLIP_S2_PER_M = 0.003


def bias_mps(recording: Recording) -> float:
    """Returns the sigma of the velocity's bias, m/s."""
    told = recording.header.noise.bias_velocity_sigma_mps
    return told if told >= 0 else BIAS_MPS


def of_lever(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Yields a fault if the extrinsic's translation seems to be of the opposite convention."""
    T = recording.T_CB
    arm = -T.R.T @ T.p
    known = np.linalg.inv(place_covariance(recording, agreed))
    as_given = float(agreed.lever_m @ known @ agreed.lever_m)
    best, likely, mended = 0.0, "", T
    for place, words in (
        (T.p, "[R | p] with the camera's position p in the body in place of -R p"),
        (-arm, "the translation with the wrong sign"),
    ):
        apart = place - arm
        left = agreed.lever_m - apart
        off = float(left @ known @ left)
        gain = as_given - off
        if off > PLACE_SURE:  # neither convention explains the place
            continue
        if float(np.sqrt(apart @ known @ apart)) > LEVER_APART and gain > max(best, LEVER_SURE):
            best, likely, mended = gain, words, Poses(T.R, -T.R @ place)
    if likely:
        yield Fault(
            "lever",
            f"turns put the camera {_metres(arm + agreed.lever_m)} in the body, the extrinsic "
            f"puts it {_metres(arm)}: it looks like {likely}",
            ratio=best,
            extrinsic=mended,
        )


def place_covariance(recording: Recording, agreed: Agreement) -> Floats:
    """Returns the covariance of the camera's place, m^2.

    It covers the turns, the accuracy of a measured place, and for twists the slip of tyres along
    the way, which twists do not show.
    """
    doubt = LEVER_SHARE * float(np.linalg.norm(recording.T_CB.p)) + 0.01
    known = np.asarray(agreed.lever_covariance + doubt**2 * np.eye(3))
    if len(recording.inertial.t_ns):
        return known
    v = recording.v_B_mps
    speed = float(np.sqrt(np.median(np.sum(v**2, axis=1))))
    ahead = np.median(v, axis=0) / (speed + 1e-12)
    return np.asarray(known + (SLIP_S2_PER_M * speed**2) ** 2 * np.outer(ahead, ahead))


def of_place(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Yields a fault if the camera is not where the extrinsic puts it.

    An IMU measures where it is itself; twists may be those of another point of the robot than the
    extrinsic's body.
    """
    T = recording.T_CB
    arm = -T.R.T @ T.p
    known = np.linalg.inv(place_covariance(recording, agreed))
    sigma = np.sqrt(np.diagonal(agreed.lever_covariance))
    told = sigma < PLACE_TOLD_M
    off = float(np.linalg.norm(agreed.lever_m[told]))
    ratio = float(agreed.lever_m @ known @ agreed.lever_m)
    if not (ratio > PLACE_SURE and off > PLACE_OFF_M):
        return
    how_well = f"known to {sigma[told].max():.2f} m"
    if len(recording.inertial.t_ns):
        words = (
            f"turns put the camera {_metres(arm + agreed.lever_m, told)} from the IMU, {how_well}; "
            f"the extrinsic puts it {_metres(arm, told)}"
        )
    else:
        words = (
            f"the velocities are those of a point {_metres(-agreed.lever_m, told)} in the body, "
            f"{how_well}: give them of the body's origin, or the extrinsic of that point; or the "
            "extrinsic's translation is off by as much"
        )
    yield Fault("lever", words, stops=False, grave=False, ratio=ratio)


def _metres(p: Floats, told: NDArray[np.bool_] | None = None) -> str:
    """Returns a place in words, with ? for components that are unknown."""
    known = np.ones(3, bool) if told is None else told
    return f"at ({', '.join(f'{x:.2f}' if k else '?' for x, k in zip(p, known, strict=True))}) m"


def of_scale(agreed: Agreement, bias_sigma: float) -> Iterator[Fault]:
    """Yields a fault if the scale is off.

    `bias_sigma` comes from the HEADER, or from the filter's settings: where the speed varies too
    little to separate scale and bias, a bias of that size explains the scale.
    """
    off, sigma = agreed.scale - 1, agreed.scale_sigma
    turn, turn_sigma = agreed.turn_scale - 1, agreed.turn_scale_sigma
    through, its_sigma = agreed.through_zero - 1, agreed.through_zero_sigma
    if abs(off) > max(SCALE_SIGMAS * sigma, SCALE_WILD) and agreed.scale < SCALE_KNOWN * sigma:
        if abs(through) > SCALE_WILD:  # else the speed hardly varies, and the scale is chance
            yield Fault(
                "no-fit",
                "camera and twists do not tell the same motion: the images show "
                f"{agreed.scale:.2f} +- {sigma:.2f} times the twists' way. Extrinsic, axes or "
                "units, but which is not told",
                ratio=(off / sigma) ** 2,
            )
        return
    if abs(off) > max(SCALE_SIGMAS * sigma, SCALE_OFF):
        words = (
            f"stereo and odometry disagree in scale: the images show {agreed.scale:.3f} +- "
            f"{sigma:.3f} times the twists' way. Baseline, focal length or the wheels' radius: "
            "which of them cannot be known"
        )
        yield _scale(words, off, sigma)
        return
    if abs(turn) > max(SCALE_SIGMAS * turn_sigma, SCALE_OFF):
        words = (
            f"stereo and odometry disagree in scale: the images show {agreed.turn_scale:.3f} +- "
            f"{turn_sigma:.3f} times the twists' turns. Focal length, a lens that is bent and not "
            "known to be, or the gyro's scale"
        )
        yield _scale(words, turn, turn_sigma)
        return
    bias = abs(through) * agreed.speed_mps
    told = bias > BIAS_SIGMAS * bias_sigma and abs(through) > SCALE_OFF
    either = abs(through - off) < 2 * sigma and abs(through) < SCALE_SIGMAS * sigma
    if told and either and abs(through) > SCALE_SIGMAS * its_sigma:
        words = (
            f"stereo and odometry disagree: the images show {agreed.through_zero:.3f} +- "
            f"{its_sigma:.3f} times the twists' way. The speed varies too little to tell a scale "
            f"that is off from a bias of {bias:.2g} m/s"
        )
        yield _scale(words, through, its_sigma)


def _scale(words: str, off: float, sigma: float) -> Fault:
    wild = abs(off) > SCALE_WILD
    return Fault("scale", words, stops=wild, grave=wild, ratio=(off / sigma) ** 2)


def of_scale_by_imu(agreed: Agreement) -> Iterator[Fault]:
    """Yields faults of scale by an IMU: of the focal length, the baseline or the gyro."""
    way = f"the images show {agreed.scale:.3f} +- {agreed.scale_sigma:.3f} times the IMU's way"
    for off, sigma, words in (
        (
            agreed.focal - 1,
            agreed.focal_sigma,
            f"a focal length of {agreed.focal:.3f} +- {agreed.focal_sigma:.3f} times the given one "
            "fits the turns best",
        ),
        (
            agreed.scale - 1,
            agreed.scale_sigma,
            f"{way}. Baseline, or the accelerometer's scale",
        ),
    ):
        if abs(off) > max(SCALE_SIGMAS * sigma, SCALE_OFF):
            yield _scale(f"stereo and IMU disagree in scale: {words}", off, sigma)
            return


def of_clock(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Yields a fault if the clock is off.

    An offset of one reading is another timing of the twists, which is then named. Where the rates
    of turn have a clock of their own, the frames are compared with the velocities'.
    """
    own = agreed.clocks
    apart = own.apart
    offset, sigma = agreed.offset_s, agreed.offset_sigma_s
    if apart:
        offset, sigma = own.ways_s, own.ways_sigma_s
    if abs(offset) > max(CLOCK_SIGMAS * sigma, CLOCK_OFF_S):
        by_imu = len(recording.inertial.t_ns) > 0
        body = "IMU" if by_imu else "velocities" if apart else "twists"
        words = (
            f"camera and {body} agree best with the frames {abs(offset) * 1e3:.0f} +- "
            f"{sigma * 1e3:.0f} ms {'later' if offset > 0 else 'earlier'} (camera-offset)"
        )
        if not by_imu:
            words += _timing(recording, offset) + _or_turns(agreed)
        settings = {"camera-offset": f"{offset:.3g}"}
        ratio = (offset / sigma) ** 2
        yield Fault("clock", words, stops=False, grave=False, ratio=ratio, settings=settings)
    if apart:
        yield Fault(
            "clock-turns",
            f"the twists' rates of turn come {abs(own.turns_late_s) * 1e3:.0f} +- "
            f"{own.turns_late_sigma_s * 1e3:.0f} ms "
            f"{'after' if own.turns_late_s > 0 else 'before'} their velocities: a filter, or "
            "stamps of another clock. No setting makes up for it: pelorus convert late-turns "
            f"--late {own.turns_late_s:.2g} moves them; on the robot, stamp the gyro earlier",
            stops=False,
            grave=False,
            ratio=(own.turns_late_s / own.turns_late_sigma_s) ** 2,
        )


def _or_turns(agreed: Agreement) -> str:
    """Returns a remark if a gyro that is late alone would explain as much."""
    own = agreed.clocks
    sure = abs(own.ways_s) > CLOCK_SIGMAS * own.ways_sigma_s
    if sure or own.apart:
        return ""
    return "; or the rates of turn alone are off by that: the velocities do not tell"


def _timing(recording: Recording, offset: float) -> str:
    """Returns a remark on the part of an offset that another timing of the twists would explain."""
    period = float(np.median(np.diff(recording.twist_t_ns))) * 1e-9
    given = recording.header.twist_timing
    lates = {TwistTiming.START: 0.0, TwistTiming.MID: 0.5 * period, TwistTiming.END: period}
    timing = min(lates, key=lambda t: abs(offset - (lates[t] - lates[given])))
    if timing is given:
        return ""
    part = (lates[timing] - lates[given]) * 1e3
    return f"; twist-timing {timing.name.lower()} would make up for {part:.0f} ms of it"
