# SPDX-License-Identifier: MIT
"""Faults of what lies between camera and body: units, axes, extrinsic, lever, scale and clocks.

Each is told by how far it is from what is due, in its own standard errors, and by whether that
matters. What the data cannot tell apart is not guessed at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pelorus.faults import imu_axes, mounting
from pelorus.faults.agreement import Agreement, agreement
from pelorus.faults.axes import turns
from pelorus.faults.fault import UNTOLD, Fault
from pelorus.faults.handeye import (
    FRAMES_ENOUGH,
    HandEye,
    angle_between,
    hand_eye,
    share_of_fit,
)
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.moving import moving
from pelorus.faults.seen import Seen
from pelorus.faults.twist_body import TwistBody
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.frames import TwistTiming
from pelorus.layout import Floats
from pelorus.recording import Recording

FIT_LEAST = 0.6  # of the point pairs that one motion explains
LEFT_MOST = 0.7  # of a motion's size that the twists leave unexplained
MOVES_MPS = 1.0  # a camera that hardly moves need not agree with the twists' noise
TURNED_DEG, ROLLED_DEG, NEAR_DEG, AXES_DEG = 6.0, 50.0, 20.0, 40.0
PITCH_MOST_DEG = 60.0
MOSTLY, HEADED_SHARE = 0.85, 0.7  # of a turn, what is about one axis, and what the way tells
PITCH_OFF_DEG, PITCH_SIGMAS = 4.0, 6.0  # where velocities and turns tell it together
SURE_SIGMAS = 4.0
UNIT_NEAR = 0.15
FAR_LAG = 3
MOVING_SHARE = 0.14  # of what is seen on roads 5 to 12 % drives, or is tracked so badly
SCALE_SIGMAS, SCALE_OFF, SCALE_WILD = 4.0, 0.015, 0.15
BIAS_MPS, BIAS_SIGMAS = 0.03, 3.0  # the default of the setting bias-velocity-sigma
SCALE_KNOWN = 10.0  # sigmas from zero: a wild scale known no better is no scale
CLOCK_SIGMAS, CLOCK_OFF_S = 4.0, 0.015
LEVER_APART, LEVER_SURE = 4.0, 16.0  # sigmas between the two places; -2 ln of likelihood
PLACE_SURE, PLACE_OFF_M = 36.0, 0.05
LEVER_SHARE = 0.05  # so well the place is known beside what turns tell


@dataclass(frozen=True)
class Judged:
    """What is wrong, and where it came to that, how far camera and body agree."""

    faults: list[Fault]
    agreed: Agreement | None = None


def geometry(recording: Recording, views: TwoViews) -> Judged:
    """`views` of neighbouring frames. Nothing where all is well."""
    by_imu = len(recording.inertial.t_ns) > 0
    wrong = list(_of_imu(recording, views) if by_imu else _of_twists(recording, views))
    if wrong:
        return Judged(wrong)
    moves = list(_moving(recording, views))
    agreed = agreement(recording, views)
    if not agreed.told:
        return Judged(moves)
    faults = [*moves, *_pitch(recording, agreed), *_lever(recording, agreed)]
    if by_imu and not any(fault.name == "lever" for fault in faults):
        faults += _place(recording, agreed)
    if not moves:  # what moves looks like another scale
        faults += _scale_by_imu(agreed) if by_imu else of_scale(agreed, _bias_mps(recording))
    return Judged([*faults, *_clock(recording, agreed)], agreed)


def _bias_mps(recording: Recording) -> float:
    """Sigma of the velocity's bias."""
    told = recording.header.noise.bias_velocity_sigma_mps
    return told if told >= 0 else BIAS_MPS


def _of_twists(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    """Too little to tell by, units, axes and the extrinsic's rotation."""
    found = hand_eye(recording, views)
    unfit = [*_unfit(found.frames, found.fit)]
    if unfit:
        yield from unfit
        return
    turned = [*_units(found)] or [*_extrinsic(recording, found, views)]
    if turned:
        yield from turned
        return
    if found.way_left > LEFT_MOST and found.speed_mps > MOVES_MPS:
        yield Fault(
            "no-fit",
            f"camera and twists do not tell the same motion ({found.way_left:.0%} of it is "
            "left unexplained), and no known fault explains why",
        )


def _of_imu(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    """The same of an IMU's."""
    seen = Seen.of(recording, views)
    unfit = [*_unfit(int(seen.usable.sum()), share_of_fit(views))]
    if unfit:
        yield from unfit
        return
    found = imu_axes.measured(recording, seen, ImuBody(recording, seen))
    if found is None:
        yield Fault(
            "time-apart", "readings and frames are of different times, hardly any in common"
        )
        return
    given = recording.T_CB.R
    why = imu_axes.explained(found, given)
    if why is None:
        return
    off = angle_between(why.of_turn, np.eye(3))
    if why.name == "no-fit":
        yield Fault(
            "no-fit",
            "camera and IMU do not tell the same motion, and no known fault explains why",
        )
    elif why.name == "inverted":
        yield _inverted(angle_between(given, given.T))
    elif why.name == "axes":
        words = _words(why.F)
        yield Fault("axes", f"the IMU's axes are turned or mirrored: {why.words} {words}")
    elif why.name != "turned":
        yield Fault(why.name, why.words)
    elif off > TURNED_DEG:
        yield _turned(given, given @ why.of_turn, off)


def _unfit(frames: int, fit: float) -> Iterator[Fault]:
    """Too little to tell by, or points that tell no motion."""
    if frames < FRAMES_ENOUGH:
        yield Fault(
            UNTOLD,
            f"only {frames} frames share points enough with the one before ({FRAMES_ENOUGH} "
            "are due): axes, units and scale cannot be judged",
            stops=False,
            grave=False,
        )
    elif fit < FIT_LEAST:
        yield Fault(
            "scene",
            f"only {fit:.0%} of the points of two frames agree on one motion: wrong ids, a "
            "wrong calibration, or much of the scene moves",
        )


# --- units ----------------------------------------------------------------------------------------


def _units(found: HandEye) -> Iterator[Fault]:
    """c = s b: with degrees b is 57 times too large, so s is 1/57."""
    for name, scale, unit, words in (
        ("degrees", found.turn_scale, np.pi / 180, "rates: they are in degrees"),
        ("degrees", found.turn_scale, 180 / np.pi, "rates: degrees were made of radians twice"),
        ("km/h", found.way_scale, 1 / 3.6, "velocities: they are in km/h"),
        ("cm/s", found.way_scale, 1e-2, "velocities: they are in cm/s"),
        ("mm/s", found.way_scale, 1e-3, "velocities: they are in mm/s"),
        ("km/h", found.way_scale, 3.6, "velocities: m/s were made of km/h twice"),
    ):
        near = UNIT_NEAR + (0.3 if abs(np.log(unit)) > np.log(10) else 0)
        if name == "degrees" and not found.turns_told:
            continue
        if scale > 0 and abs(np.log(scale / unit)) < near:
            yield Fault(f"unit-{name}", f"the images show {scale:.3g} times the {words}")


# --- axes and extrinsic ---------------------------------------------------------------------------


def _extrinsic(recording: Recording, found: HandEye, views: TwoViews) -> Iterator[Fault]:
    """The rotation, and whether each of the twists' axes is the one that is meant."""
    given = recording.T_CB.R
    off = angle_between(found.R, given)
    sure = off > SURE_SIGMAS * _sigma_deg(found, given)
    rolled = off > ROLLED_DEG and found.turns_told
    axes = list(_axes(recording, views))
    cosine = float((found.R @ found.heading_B) @ (given @ found.heading_B))
    headed = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    if axes and sure and angle_between(found.R, given.T) < NEAR_DEG:
        yield _inverted(off)
    elif axes:
        yield from axes
    # the way tells where the camera looks; the roll about it only the turns do, which may be noise
    elif (
        sure and found.way_left < LEFT_MOST and (headed > _straight_deg(recording, found) or rolled)
    ):
        of_way = np.cross(given @ found.heading_B, found.R @ found.heading_B)
        by_pitch = abs(of_way[0]) > MOSTLY * float(np.linalg.norm(of_way))
        if off < NEAR_DEG and _otherwise(recording, views, off):
            return
        if by_pitch and HEADED_SHARE * off < headed and off < NEAR_DEG:
            yield _pitched(f"{headed:.0f}")  # the rest is roll, known worse
        else:
            yield _turned(given, found.R, off)


def _otherwise(recording: Recording, views: TwoViews, off: float) -> bool:
    """Whether what looks like a turn is none once all else may be wrong as well: at walking speed a
    lever that is off turns the way of the camera by as much.
    """
    agreed = agreement(recording, views)
    if agreed.tilt_rad is None or agreed.tilt_covariance is None:
        return False
    left = float(np.degrees(np.linalg.norm(agreed.tilt_rad)))
    sigma = float(np.degrees(np.sqrt(np.trace(agreed.tilt_covariance))))
    return left + SURE_SIGMAS * sigma < off / 2


def _straight_deg(recording: Recording, found: HandEye) -> float:
    """Within which the way is along the camera: a bias across it turns it."""
    bias = BIAS_SIGMAS * _bias_mps(recording) / (found.speed_mps + 1e-12)
    return float(np.hypot(TURNED_DEG, np.degrees(np.arctan(bias))))


def _axes(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    seen = Seen.of(recording, views)
    rates = TwistBody(recording).rates(recording.frame_t_ns, 1, 0.0)
    arm = -recording.T_CB.R.T @ recording.T_CB.p
    own = np.where(seen.usable[:, None], seen.rates, np.nan)
    of_turn = mounting.best_axes(own[:, 3:], rates[:, 3:])
    turn = own[:, 3:]
    of_way = mounting.best_axes(own[:, :3] - np.cross(turn, arm), rates[:, :3], turn)
    both = of_turn.won and of_way.won and np.array_equal(of_turn.F, of_way.F)
    if both or (of_turn.won and not of_way.won):
        whose = "the twists have" if both else "the rates of turn have"
        yield Fault("axes", f"the body's axes are turned or mirrored: {whose} {_words(of_turn.F)}")
    elif of_way.won:
        words = f"the velocities have {_words(of_way.F)}"
        if of_turn.won:
            words += f", the rates of turn {_words(of_turn.F)}"
        yield Fault("axes", f"the body's axes are turned or mirrored: {words}")


def _words(F: Floats) -> str:
    """y for x, -z for z: y = F b, so what stands as b's k-th is that axis of what is due."""
    parts = [f"{_axis_name(column)} for {'xyz'[k]}" for k, column in enumerate(F.T)]
    return ", ".join(part for k, part in enumerate(parts) if not part.startswith("xyz"[k]))


def _inverted(off: float) -> Fault:
    return Fault(
        "inverted",
        f"the extrinsic is off by {off:.0f} degrees, and fits inverted: R_CB is body to camera",
    )


def _turned(given: Floats, found: Floats, off: float) -> Fault:
    if angle_between(found, given.T) < NEAR_DEG:
        return _inverted(off)
    turned = min(turns(), key=lambda F: angle_between(found, given @ F))
    if not np.allclose(turned, np.eye(3)) and angle_between(found, given @ turned) < AXES_DEG:
        words = _words(turned)
        return Fault("axes", f"the body's axes are turned or mirrored: the twists have {words}")
    axis = _axis_of(found @ given.T)
    if abs(axis[0]) > MOSTLY and off < PITCH_MOST_DEG:
        return _pitched(f"{off:.0f}")
    return Fault("extrinsic", f"the extrinsic's rotation is off by {off:.0f} degrees")


def _pitch(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """A few degrees, which the way alone cannot tell from a velocity that is biased across it."""
    if agreed.tilt_rad is None or agreed.tilt_covariance is None:
        return
    across = recording.T_CB.R[0]  # the camera's x in the body
    off = float(np.degrees(across @ agreed.tilt_rad))
    sigma = float(np.degrees(np.sqrt(across @ agreed.tilt_covariance @ across)))
    if abs(off) > max(PITCH_SIGMAS * sigma, PITCH_OFF_DEG):
        yield _pitched(f"{abs(off):.1f} +- {sigma:.1f}")


def _pitched(degrees: str) -> Fault:
    words = f"the camera is pitched by {degrees} degrees beside the extrinsic: forgotten?"
    return Fault("pitch", words)


def _sigma_deg(found: HandEye, given: Floats) -> float:
    """How well the turn between the two rotations is known. Of a drive straight ahead nothing tells
    the roll.
    """
    axis = _axis_of(found.R @ given.T)
    return float(np.degrees(np.sqrt(axis @ found.R_covariance @ axis)))


def _axis_name(row: Floats) -> str:
    return ("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))]


def _axis_of(R: Floats) -> Floats:
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.asarray(axis / (np.linalg.norm(axis) + 1e-12))


# --- lever, scale and clock -----------------------------------------------------------------------


def _lever(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Is the camera rather where a translation that was mistaken for another one puts it?"""
    T = recording.T_CB
    arm = -T.R.T @ T.p
    doubt = LEVER_SHARE * float(np.linalg.norm(arm)) + 0.01
    known = np.linalg.inv(agreed.lever_covariance + doubt**2 * np.eye(3))
    as_given = float(agreed.lever_m @ known @ agreed.lever_m)
    best, likely = 0.0, ""
    for place, words in (
        (T.p, "[R | p] with the camera's position p in the body in place of -R p"),
        (-arm, "the translation with the wrong sign"),
    ):
        apart = place - arm
        left = agreed.lever_m - apart
        gain = as_given - float(left @ known @ left)
        if float(np.sqrt(apart @ known @ apart)) > LEVER_APART and gain > max(best, LEVER_SURE):
            best, likely = gain, words
    if likely:
        yield Fault(
            "lever",
            f"turns put the camera {_metres(arm + agreed.lever_m)} in the body, the extrinsic "
            f"puts it {_metres(arm)}: it looks like {likely}",
        )


def _place(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Is the camera where it is said to be? Of an IMU, which measures where it is; wheels measure
    the velocity of some other point than the one that their data sheet names.
    """
    T = recording.T_CB
    arm = -T.R.T @ T.p
    doubt = LEVER_SHARE * float(np.linalg.norm(arm)) + 0.01
    known = np.linalg.inv(agreed.lever_covariance + doubt**2 * np.eye(3))
    off = float(np.linalg.norm(agreed.lever_m))
    if float(agreed.lever_m @ known @ agreed.lever_m) > PLACE_SURE and off > PLACE_OFF_M:
        sigma = np.sqrt(np.diagonal(agreed.lever_covariance))
        yield Fault(
            "lever",
            f"turns put the camera {_metres(arm + agreed.lever_m)} from the IMU, known to "
            f"{sigma.max():.2f} m; the extrinsic puts it {_metres(arm)}",
            stops=False,
            grave=False,
        )


def _metres(p: Floats) -> str:
    return "at (" + ", ".join(f"{x:.2f}" for x in p) + ") m"


def of_scale(agreed: Agreement, bias_sigma: float) -> Iterator[Fault]:
    """`bias_sigma` as the HEADER tells it, or else as the filter's settings allow it: where the
    speed varies too little to tell a scale from a bias, one of that size is nothing new.
    """
    off, sigma = agreed.scale - 1, agreed.scale_sigma
    turn, turn_sigma = agreed.turn_scale - 1, agreed.turn_scale_sigma
    through, its_sigma = agreed.through_zero - 1, agreed.through_zero_sigma
    if abs(off) > max(SCALE_SIGMAS * sigma, SCALE_WILD) and agreed.scale < SCALE_KNOWN * sigma:
        yield Fault(
            "no-fit",
            f"camera and twists do not tell the same motion: the images show {agreed.scale:.2f} +- "
            f"{sigma:.2f} times the twists' way. Extrinsic, axes or units, but which is not told",
        )
        return
    if abs(off) > max(SCALE_SIGMAS * sigma, SCALE_OFF):
        yield Fault(
            "scale",
            f"stereo and odometry disagree in scale: the images show {agreed.scale:.3f} +- "
            f"{sigma:.3f} times the twists' way. Baseline, focal length or the wheels' radius: "
            "which of them cannot be known",
            stops=abs(off) > SCALE_WILD,
            grave=abs(off) > SCALE_WILD,
        )
        return
    if abs(turn) > max(SCALE_SIGMAS * turn_sigma, SCALE_OFF):
        yield Fault(
            "scale",
            f"stereo and odometry disagree in scale: the images show {agreed.turn_scale:.3f} +- "
            f"{turn_sigma:.3f} times the twists' turns. Focal length or the gyro's scale",
            stops=abs(turn) > SCALE_WILD,
            grave=abs(turn) > SCALE_WILD,
        )
        return
    bias = abs(through) * agreed.speed_mps
    told = bias > BIAS_SIGMAS * bias_sigma and abs(through) > SCALE_OFF
    either = abs(through - off) < 2 * sigma and abs(through) < SCALE_SIGMAS * sigma
    if told and either and abs(through) > SCALE_SIGMAS * its_sigma:
        wild = abs(through) > SCALE_WILD
        yield Fault(
            "scale",
            f"stereo and odometry disagree: the images show {agreed.through_zero:.3f} +- "
            f"{its_sigma:.3f} times the twists' way. The speed varies too little to tell a scale "
            f"that is off from a bias of {bias:.2g} m/s",
            stops=wild,
            grave=wild,
        )


def _scale_by_imu(agreed: Agreement) -> Iterator[Fault]:
    """Turns tell the focal length, forces the baseline; the gyro's scale is the rest."""
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
            wild = abs(off) > SCALE_WILD
            yield Fault(
                "scale", f"stereo and IMU disagree in scale: {words}", stops=wild, grave=wild
            )
            return


def _clock(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """One reading later or earlier is another timing: what of it a timing explains is said. Where
    the rates of turn have a clock of their own, the frames are held to the velocities'.
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
            words += _timing(recording, offset)
        yield Fault("clock", words, stops=False, grave=False)
    if apart:
        yield Fault(
            "clock-turns",
            f"the twists' rates of turn come {abs(own.turns_late_s) * 1e3:.0f} +- "
            f"{own.turns_late_sigma_s * 1e3:.0f} ms "
            f"{'after' if own.turns_late_s > 0 else 'before'} their velocities: a filter, or "
            "stamps of another clock. No setting makes up for it: move the gyro's stamps",
            stops=False,
            grave=False,
        )


def _timing(recording: Recording, offset: float) -> str:
    """What of an offset another timing of the twists would explain."""
    period = float(np.median(np.diff(recording.twist_t_ns))) * 1e-9
    given = recording.header.twist_timing
    lates = {TwistTiming.START: 0.0, TwistTiming.MID: 0.5 * period, TwistTiming.END: period}
    timing = min(lates, key=lambda t: abs(offset - (lates[t] - lates[given])))
    if timing is given:
        return ""
    part = (lates[timing] - lates[given]) * 1e3
    return f"; twist-timing {timing.name.lower()} would make up for {part:.0f} ms of it"


def _moving(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    far = two_views(recording.tracks, recording.header.camera, FAR_LAG)
    found = moving(recording.tracks, views, far)
    if found.share > MOVING_SHARE:
        yield Fault(
            "moving",
            f"{found.share:.0%} of what is seen moves beside the rest ({found.tracks} tracks of "
            "some length)",
            stops=False,
            grave=False,
        )
