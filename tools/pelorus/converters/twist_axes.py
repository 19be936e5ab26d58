# SPDX-License-Identifier: MIT
"""Finds the axes in which odometry gives its velocities, and turns these into the body's.

nav_msgs/Odometry wants them in the body's axes. Some drivers give those of the world, both or the
velocity alone, and some fill in the pose and leave the twist at zero. The poses that come with them
decide.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from pelorus.converters.streams import TwistIn, Twists
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.math import motion
from pelorus.math.se3 import Poses
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

CHANCE = 1e-4  # probability that twists in the body's axes look like those of the world
RESTS = 1e-6  # m and rad: largest change of a pose at rest


def in_body(
    twists: Twists, poses: Poses | None, asked: TwistIn, timing: TwistTiming, remarks: list[str]
) -> Twists:
    """Returns the twists in body axes, by poses (body to world) of the same times, if any."""
    if asked is TwistIn.BODY or (asked is TwistIn.AUTO and not (poses and twists.is_whole)):
        return twists
    if poses is None:
        raise ForeignFileError(
            twists.where,
            f"has no orientation, and --twist-in {asked.value} turns by it; nav_msgs/Odometry with "
            "its pose is expected, or CSV with qx, qy, qz, qw (and px_m, py_m, pz_m)",
        )
    if not twists.is_whole:
        raise PelorusError(f"--twist-in {asked.value}: all six velocities are expected")
    has_place = bool(np.isfinite(poses.p).all())
    if asked is TwistIn.AUTO:
        asked = _axes_by_poses(twists, poses, remarks) if has_place else TwistIn.BODY
    if asked is TwistIn.POSES:
        if not has_place:
            raise ForeignFileError(twists.where, "has no places; px_m, py_m, pz_m are expected")
        return _of_poses(twists, poses, timing)
    v, w = twists.v_B_mps, twists.w_B_radps
    if asked in (TwistIn.WORLD, TwistIn.WORLD_VELOCITY):
        v = _into_body(poses, v)
    if asked is TwistIn.WORLD:
        w = _into_body(poses, w)
    return replace(twists, v_B_mps=v, w_B_radps=w)


def _into_body(poses: Poses, x_W: Floats) -> Floats:
    return np.asarray(np.einsum("nji,nj->ni", poses.R, x_W))


def _axes_by_poses(twists: Twists, poses: Poses, remarks: list[str]) -> TwistIn:
    """Returns the axes by the poses, and adds a remark on them."""
    v, w = twists.v_B_mps, twists.w_B_radps
    where = str(twists.where)
    if not v.any() and not w.any():
        moved = max(float(np.abs(part - part[:1]).max()) for part in poses)
        if moved < RESTS:
            return TwistIn.BODY
        remarks.append(
            f"{where}: all {len(v)} twists are zero and the poses move: twists are made of the "
            "poses (--twist-in body takes them as they are)"
        )
        return TwistIn.POSES
    rate = motion.rates(twists.t_ns, poses)
    before = poses.at(slice(None, -1))
    seconds = float(twists.t_ns[-1] - twists.t_ns[0]) * 1e-9
    turned = [
        _fits_the_world(motion.held(x, TwistTiming.MID), own, before, seconds)
        for x, own in ((v, rate[:, :3]), (w, rate[:, 3:]))
    ]
    if not turned[0]:
        return TwistIn.BODY
    found = TwistIn.WORLD if turned[1] else TwistIn.WORLD_VELOCITY
    what = "velocities and rates" if turned[1] else "velocities"
    remarks.append(
        f"{where}: its poses say that its {what} are in world axes, where nav_msgs/Odometry wants "
        f"the body's: turned (as --twist-in {found.value} does; --twist-in body would believe them)"
    )
    return found


def _fits_the_world(x: Floats, x_B: Floats, before: Poses, seconds: float) -> bool:
    """Returns whether x fits the poses in world axes better than x_B, its form in body axes.

    Errors of odometry last: those of one second count as one draw of three numbers.
    """
    x_W = np.einsum("nij,nj->ni", before.R, x_B)
    in_body, in_world = (float(np.sum((x - own) ** 2)) for own in (x_B, x_W))
    draws = 3 * max(min(int(seconds), len(x)), 1)
    return in_body > float(scipy.special.fdtri(draws, draws, 1 - CHANCE)) * in_world


def _of_poses(twists: Twists, poses: Poses, timing: TwistTiming) -> Twists:
    """Returns the twists that move each pose to the next, at the times of the timing."""
    t_ns, rate = twists.t_ns, motion.rates(twists.t_ns, poses)
    if timing is TwistTiming.MID:
        t_ns = t_ns[:-1] + np.diff(t_ns) // 2
    elif timing is TwistTiming.START:
        rate = np.concatenate((rate, rate[-1:]))
    else:
        rate = np.concatenate((rate[:1], rate))
    return Twists(twists.where, t_ns, rate[:, :3], rate[:, 3:], frame=twists.frame)
