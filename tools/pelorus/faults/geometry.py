# SPDX-License-Identifier: MIT
"""Detects faults between camera and body: units, axes, extrinsic, lever, scale and clocks.

Each is judged by its distance from the expected value in standard errors, and by whether it
matters. What the data cannot separate is not guessed at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pelorus.faults import imu_axes, mounting, platform
from pelorus.faults.agreement import Agreement, agreement, halved
from pelorus.faults.amounts import (
    BIAS_SIGMAS,
    bias_mps,
    of_clock,
    of_lever,
    of_place,
    of_scale,
    of_scale_by_imu,
)
from pelorus.faults.fault import UNTOLD, Fault
from pelorus.faults.handeye import (
    FRAMES_ENOUGH,
    HandEye,
    angle_between,
    hand_eye,
    share_of_fit,
)
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.likelihood import of_estimate, of_share
from pelorus.faults.moving import USUAL, Moving
from pelorus.faults.seen import CameraMotion
from pelorus.faults.twist_body import TwistBody
from pelorus.faults.two_views import TwoViews
from pelorus.faults.world_axes import world_axes
from pelorus.io.recording import Recording
from pelorus.math.axes import turns
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

FIT_LEAST = 0.6  # share of the point pairs that one motion explains
LEFT_MOST = 0.7  # share of a motion's size that the twists leave unexplained
MOVES_MPS = 1.0  # a slower camera need not agree with the twists' noise
TURNED_DEG, ROLLED_DEG, NEAR_DEG, AXES_DEG = 6.0, 50.0, 20.0, 40.0
PITCH_MOST_DEG = 60.0
MOSTLY, HEADED_SHARE = 0.85, 0.7  # share of a turn about one axis, and share that the heading shows
PITCH_OFF_DEG, PITCH_SIGMAS = 4.0, 4.0  # where velocities and turns show it together
SURE_SIGMAS = 4.0
MOVES_SIGMAS, WORLD_SURE = 4.0, 16.0  # standard errors; 2 ln of the likelihood ratio
UNIT_NEAR = 0.15
UNEXPLAINED = ("no-fit", "scene")


Ask = Callable[[], Agreement]


@dataclass(frozen=True)
class Judged:
    """The faults that were found.

    Where they were reached: how far camera and body agree, and the views between neighbouring
    frames of the first part that showed it.
    """

    faults: list[Fault]
    agreed: Agreement | None = None
    views: TwoViews | None = None


def geometry(recording: Recording, views: TwoViews, moved: Callable[[], Moving]) -> Judged:
    """Looks for faults of geometry; `views` are of neighbouring frames."""
    by_imu = len(recording.inertial.t_ns) > 0
    ask = cache(lambda: agreement(recording, views, seen))  # it takes longer than all else
    seen = CameraMotion.of(recording, views)
    wrong = [*_unfit(int(seen.usable.sum()), share_of_fit(views))] or [*_standing(seen, moved)]
    if not wrong:
        seen = halved(recording, seen, views.lag) if by_imu else seen
        wrong = [*(_of_imu(recording, seen) if by_imu else _of_twists(recording, seen, views, ask))]
    unexplained = [fault for fault in wrong if fault.name in UNEXPLAINED]
    if wrong and not unexplained:
        return Judged(wrong)
    moves = list(_moving(moved(), bool(unexplained)))
    if wrong:  # moving objects explain it
        return Judged(moves or wrong)
    agreed = ask()
    if not agreed.is_known:
        return Judged(moves)
    faults = moves
    if not moves:  # moving objects look like another scale or place of the camera
        faults = [*_pitch(recording, agreed), *of_lever(recording, agreed)]
        if by_imu and not any(fault.name == "lever" for fault in faults):
            faults += of_place(recording, agreed)
        faults += of_scale_by_imu(agreed) if by_imu else of_scale(agreed, bias_mps(recording))
    faults = [*faults, *of_clock(recording, agreed)]
    if not (faults or by_imu):  # another fault may shift the place
        faults = list(of_place(recording, agreed))
    return Judged(faults, agreed)


def _of_twists(
    recording: Recording, seen: CameraMotion, views: TwoViews, ask: Ask
) -> Iterator[Fault]:
    """Yields faults of units, axes and the extrinsic's rotation, by twists."""
    found = hand_eye(recording, views)
    if not found.is_known:
        yield _untold(found.frames)
        return
    if not (recording.v_B_mps.any() or recording.w_B_radps.any()):
        yield Fault(
            "twists-zero",
            f"all {len(recording.twist_t_ns)} twists are zero, the pictures move "
            f"({found.speed_mps:.2g} m/s): is only the pose filled in? Velocities in body axes are "
            "due, or --twist-in poses when it is converted",
        )
        return
    turned = [*_units(found)] or [*_extrinsic(recording, found, views, ask)]
    if found.way_left > LEFT_MOST and found.speed_mps > MOVES_MPS:
        turned = turned or [
            Fault(
                "no-fit",
                f"camera and twists do not tell the same motion ({found.way_left:.0%} of it is "
                "left unexplained), and no known fault explains why",
                ratio=of_estimate(found.way_scale, 1.0, found.way_scale, found.way_sigma),
            )
        ]
    yield from _in_world(recording, seen) or turned


def _in_world(recording: Recording, seen: CameraMotion) -> list[Fault]:
    """Returns a fault if the velocities are in axes that do not turn with the body."""
    ratio = world_axes(recording, seen)
    if ratio < WORLD_SURE:
        return []
    return [
        Fault(
            "world-axes",
            "the velocities are in world axes (odom, map), and not in the body's: so they fit the "
            "pictures. Turn each by the pose's attitude, v_body = R^T v_world, or have it done: "
            "--twist-in world (world-velocity, if the rates of turn are the body's) when it is "
            "converted",
            ratio=ratio,
        )
    ]


def _of_imu(recording: Recording, seen: CameraMotion) -> Iterator[Fault]:
    """Yields faults of units, axes and the extrinsic's rotation, by an IMU."""
    body = ImuBody(recording, seen)
    found = imu_axes.measured(recording, seen, body)
    if found is None:
        yield Fault(
            "time-apart", "readings and frames are of different times, hardly any in common"
        )
        return
    why = imu_axes.explained(found, recording.T_CB.R)
    if why is None:
        return
    at_times = _at_times(recording, seen, body)
    if at_times is not None:
        yield at_times
        return
    fault = _why(why, recording.T_CB)
    if fault is not None:
        none = replace(why, of_turn=np.eye(3), of_force=np.eye(3))
        yield replace(fault, ratio=found.held_against(none) - found.held_against(why))


def _at_times(recording: Recording, seen: CameraMotion, body: ImuBody) -> Fault | None:
    """Returns a fault if camera and IMU disagree for some of the time only."""
    wrong = platform.disagreeing(recording, seen, body)
    if not wrong.any():
        return None
    t_s = body.frame_s(recording.frame_t_ns, 0.0)
    others = seen.without(wrong)
    edges = np.nonzero(np.diff(wrong.astype(np.int8)))[0] + 1
    found = imu_axes.measured(recording, others, body, t_s[edges])
    if found is None or imu_axes.explained(found, recording.T_CB.R) is not None:
        return None
    since = t_s - t_s[0]
    return Fault(
        "platform",
        f"IMU and pictures do not tell the same motion {platform.words(since, wrong)}, and do "
        "otherwise: a moving platform (lift, vehicle, ship), or much of the picture that moves?",
        stops=False,
        grave=False,
    )


def _why(why: imu_axes.Explained, given: Poses) -> Fault | None:
    """Returns the explanation as a fault; None where a turn is too small to matter."""
    off = angle_between(why.of_turn, np.eye(3))
    if why.name == "no-fit":
        words = "camera and IMU do not tell the same motion, and no known fault explains why"
        return Fault("no-fit", words)
    if why.name == "inverted":
        return _inverted(angle_between(given.R, given.R.T))
    if why.name == "axes":
        words = f"the IMU's axes are turned or mirrored: {why.words} {_words(why.F)}"
        return Fault("axes", words)
    if why.name != "turned":
        return Fault(why.name, why.words)
    return _turned(given, given.R @ why.of_turn, off) if off > TURNED_DEG else None


def _unfit(frames: int, fit: float) -> Iterator[Fault]:
    """Yields a fault where there are too few data, or the points fit no motion."""
    if frames < FRAMES_ENOUGH:
        yield _untold(frames)
    elif fit < FIT_LEAST:
        yield Fault(
            "scene",
            f"only {fit:.0%} of the points of two frames agree on one motion: wrong ids, a "
            "wrong calibration, or much of the scene moves",
            ratio=of_share(1 - fit, frames, 1 - FIT_LEAST),
        )


def _untold(frames: int) -> Fault:
    words = f"only {frames} frames share points enough with the one before ({FRAMES_ENOUGH} are "
    words += "due): axes, units and scale cannot be judged"
    return Fault(UNTOLD, words, stops=False, grave=False)


def _standing(seen: CameraMotion, moved: Callable[[], Moving]) -> Iterator[Fault]:
    """Yields a fault where the camera stands, for its motion is then noise."""
    if seen.moves < MOVES_SIGMAS and not moved().more_than_usual:
        how = "shakes for some time, and hardly moves" if seen.shakes else "stands all along"
        words = f"the camera {how}: axes, units, scale, clock and place cannot be judged"
        yield Fault(UNTOLD, f"{words}. Drive, with turns", stops=False, grave=False)


# --- units ----------------------------------------------------------------------------------------


def _units(found: HandEye) -> Iterator[Fault]:
    """Yields a fault of units by c = s b: with degrees b is 57 times too large, so s is 1/57."""
    turns = found.turn_scale, found.turn_sigma
    ways = found.way_scale, found.way_sigma
    for name, (scale, sigma), unit, words in (
        ("degrees", turns, np.pi / 180, "rates: they are in degrees"),
        ("degrees", turns, 180 / np.pi, "rates: degrees were made of radians twice"),
        ("km/h", ways, 1 / 3.6, "velocities: they are in km/h"),
        ("cm/s", ways, 1e-2, "velocities: they are in cm/s"),
        ("mm/s", ways, 1e-3, "velocities: they are in mm/s"),
        ("km/h", ways, 3.6, "velocities: m/s were made of km/h twice"),
    ):
        near = UNIT_NEAR + (0.3 if abs(np.log(unit)) > np.log(10) else 0)
        if name == "degrees" and not found.turns_are_known:
            continue
        if scale > 0 and abs(np.log(scale / unit)) < near:
            shown = f"the images show {scale:.3g} times the {words}"
            yield Fault(f"unit-{name}", shown, ratio=of_estimate(scale, 1.0, unit, sigma))
            return  # a lever's displacements depend on the turns, too


# --- axes and extrinsic ---------------------------------------------------------------------------


def _extrinsic(recording: Recording, found: HandEye, views: TwoViews, ask: Ask) -> Iterator[Fault]:
    """Yields faults of the rotation, and of single axes of the twists."""
    given = recording.T_CB.R
    off = angle_between(found.R, given)
    sigmas = off / _sigma_deg(found, given)
    sure = sigmas > SURE_SIGMAS
    rolled = off > ROLLED_DEG and found.turns_are_known
    axes = list(_axes(recording, views))
    cosine = float((found.R @ found.heading_B) @ (given @ found.heading_B))
    headed = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    if axes and sure and angle_between(found.R, given.T) < NEAR_DEG:
        yield replace(_inverted(off), ratio=sigmas**2)
    elif axes:
        yield from axes
    # velocities show where the camera looks; only turns show the roll about it, and they may be
    # noise
    elif (
        sure and found.way_left < LEFT_MOST and (headed > _straight_deg(recording, found) or rolled)
    ):
        of_way = np.cross(given @ found.heading_B, found.R @ found.heading_B)
        by_pitch = abs(of_way[0]) > MOSTLY * float(np.linalg.norm(of_way))
        if off < NEAR_DEG and _otherwise(ask(), off):
            return
        if by_pitch and HEADED_SHARE * off < headed and off < NEAR_DEG:
            fault = _pitched(f"{headed:.0f}")  # the rest is roll, which is known worse
        else:
            fault = _turned(recording.T_CB, found.R, off)
        yield replace(fault, ratio=sigmas**2)


def _otherwise(agreed: Agreement, off: float) -> bool:
    """Returns whether other unknowns explain the turn: a wrong lever looks like one."""
    if agreed.tilt_rad is None or agreed.tilt_covariance is None:
        return False
    left = float(np.degrees(np.linalg.norm(agreed.tilt_rad)))
    sigma = float(np.degrees(np.sqrt(np.trace(agreed.tilt_covariance))))
    return left + SURE_SIGMAS * sigma < off / 2


def _straight_deg(recording: Recording, found: HandEye) -> float:
    """Returns how far a bias across the way may turn the camera's heading, degrees."""
    bias = BIAS_SIGMAS * bias_mps(recording) / (found.speed_mps + 1e-12)
    return float(np.hypot(TURNED_DEG, np.degrees(np.arctan(bias))))


def _axes(recording: Recording, views: TwoViews) -> Iterator[Fault]:
    seen = CameraMotion.of(recording, views)
    rates = TwistBody(recording).rates(recording.frame_t_ns, 1, 0.0)
    arm = -recording.T_CB.R.T @ recording.T_CB.p
    own = np.where(seen.usable[:, None], seen.rates, np.nan)
    turn = own[:, 3:]
    of_way, of_turn = mounting.best_of_both(
        mounting.MotionPairs(own[:, :3] - np.cross(turn, arm), rates[:, :3], turn),
        mounting.MotionPairs(turn, rates[:, 3:]),
    )
    won = {
        whose: found
        for whose, found in (("the velocities", of_way), ("the rates of turn", of_turn))
        if found.won
    }
    if not won:
        return
    words = ", ".join(f"{whose} have {_words(found.F)}" for whose, found in won.items())
    if len(won) > 1 and np.array_equal(of_turn.F, of_way.F):
        words = f"the twists have {_words(of_turn.F)}"
    ratio = sum(found.ratio for found in won.values())
    F, *others = (found.F for found in won.values())
    is_turn = all(np.array_equal(F, other) for other in others) and np.linalg.det(F) > 0
    mended = Poses(recording.T_CB.R @ F, recording.T_CB.p) if is_turn else None
    words = f"the body's axes are turned or mirrored: {words}"
    yield Fault("axes", words, ratio=ratio, extrinsic=mended)


def _words(F: Floats) -> str:
    """Returns the axes in words: y for x, -z for z. With y = F b, b's k-th axis is given by F."""
    parts = [f"{_axis_name(column)} for {'xyz'[k]}" for k, column in enumerate(F.T)]
    return ", ".join(part for k, part in enumerate(parts) if not part.startswith("xyz"[k]))


def _inverted(off: float) -> Fault:
    return Fault(
        "inverted",
        f"the extrinsic is off by {off:.0f} degrees, and fits inverted: R_CB is body to camera",
    )


def _turned(given: Poses, found: Floats, off: float) -> Fault:
    if angle_between(found, given.R.T) < NEAR_DEG:
        return _inverted(off)
    turned = min(turns(), key=lambda F: angle_between(found, given.R @ F))
    if not np.allclose(turned, np.eye(3)) and angle_between(found, given.R @ turned) < AXES_DEG:
        words = f"the body's axes are turned or mirrored: the twists have {_words(turned)}"
        return Fault("axes", words, extrinsic=Poses(given.R @ turned, given.p))
    axis = _axis_of(found @ given.R.T)
    if abs(axis[0]) > MOSTLY and off < PITCH_MOST_DEG:
        return _pitched(f"{off:.0f}")
    return Fault("extrinsic", f"the extrinsic's rotation is off by {off:.0f} degrees")


def _pitch(recording: Recording, agreed: Agreement) -> Iterator[Fault]:
    """Yields a fault of a few degrees of pitch, which for velocities alone may be a bias."""
    if agreed.tilt_rad is None or agreed.tilt_covariance is None:
        return
    across = recording.T_CB.R[0]  # the camera's x in the body
    off = float(np.degrees(across @ agreed.tilt_rad))
    sigma = float(np.degrees(np.sqrt(across @ agreed.tilt_covariance @ across)))
    if abs(off) > max(PITCH_SIGMAS * sigma, PITCH_OFF_DEG):
        yield replace(_pitched(f"{abs(off):.1f} +- {sigma:.1f}"), ratio=(off / sigma) ** 2)


def _pitched(degrees: str) -> Fault:
    words = f"the camera is pitched by {degrees} degrees beside the extrinsic: forgotten?"
    return Fault("pitch", words)


def _sigma_deg(found: HandEye, given: Floats) -> float:
    """Returns the standard error of the turn between both rotations; straight ways leave roll
    open.
    """
    axis = _axis_of(found.R @ given.T)
    return float(np.degrees(np.sqrt(axis @ found.R_covariance @ axis)))


def _axis_name(row: Floats) -> str:
    return ("-" if row.sum() < 0 else "") + "xyz"[int(np.argmax(np.abs(row)))]


def _axis_of(R: Floats) -> Floats:
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.asarray(axis / (np.linalg.norm(axis) + 1e-12))


# --- the scene ------------------------------------------------------------------------------------


def _moving(found: Moving, misleads: bool) -> Iterator[Fault]:
    """Yields a fault of moving objects.

    `misleads`: nothing else explains why camera and body show different motions.
    """
    if found.more_than_usual:
        so = ": camera and body do not tell the same motion" if misleads else ""
        yield Fault(
            "moving",
            f"{found.share:.0%} of what is seen moves beside the rest ({found.tracks} tracks of "
            f"some length){so}",
            stops=misleads,
            grave=misleads,
            ratio=of_share(found.share, found.tracks, USUAL),
        )
