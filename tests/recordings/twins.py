# SPDX-License-Identifier: MIT
"""Float32 beside float64 over a recording, frame by frame: where the two part.

usage: twins.py RECORDING.plr [--bin build/bin] [--every N] [--only-parted] [-- REPLAY OPTIONS]
       twins.py mh01.plr --only-parted -- --config tools/config/imu-adis16448.conf

First comes what the whole drive comes to: how far apart the two are, how often each diverged, and
the frame at which they first part by more than a tenth of float64's sigma. With --every N or
--only-parted a line for each such frame:

t           s since the first frame
apart       of the two poses, m and rad
in sigmas   the largest component of the distance in float64's sigmas
sigma32/64  largest and smallest ratio of the two sigmas of pose and velocity
least       smallest pivot of each correlation matrix, pose and velocity, float32's and float64's:
            1 where nothing correlates; below 1e-6 float32 has few digits left
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from judge import ROOT, run
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire import schema
from pelorus.wire.frames import Kind, Message, Pose, Report
from pelorus.wire.layout import Floats, unpack_symmetric

PROGRAMS = ("pelorus-replay", "pelorus-replay-f64")
PARTED = 0.1  # of a sigma
RECOVERED = schema.number("reason", "RECOVERED")


class Frame(NamedTuple):
    """The estimate of one precision after a frame."""

    pose: Pose
    P: Floats  # of the pose
    P_u: Floats  # of (v, w)
    recovered: bool


class Pair(NamedTuple):
    """Both precisions at a frame."""

    t_s: float
    apart_m: float
    apart_rad: float
    in_sigmas: float
    ratio: tuple[float, float]
    least: tuple[float, ...]
    recovered: tuple[bool, bool]

    @property
    def parted(self) -> bool:
        return not self.in_sigmas <= PARTED or self.recovered[0] != self.recovered[1]


def frames_of(messages: Sequence[Message]) -> Iterator[tuple[int, Frame]]:
    """Yields frames by time, without those that have no covariance, which recovered before."""
    recovered = {
        m.t_ns
        for m in messages
        if isinstance(m, Report) and m.subject == Kind.STEREO and m.reasons & RECOVERED
    }
    for m in messages:
        if isinstance(m, Pose) and m.after_stereo:
            P, P_u = unpack_symmetric(np.array((m.covariance, m.velocity_covariance)), 6)
            yield m.t_ns, Frame(m, P, P_u, m.t_ns in recovered)


def least_pivot(P: Floats) -> float:
    """Returns the smallest pivot of the Cholesky factor of P as a correlation matrix, squared.

    It is negative where P is not positive.
    """
    diagonal = np.diag(P)
    if not (diagonal > 0).all():
        return float(diagonal.min())
    scaled = P / np.sqrt(np.outer(diagonal, diagonal))
    try:
        return float(np.diag(np.linalg.cholesky(scaled)).min() ** 2)
    except np.linalg.LinAlgError:
        return float(np.linalg.eigvalsh(scaled)[0])


def compared(a: Frame, b: Frame, t_s: float) -> Pair:
    """Compares float32's frame with float64's."""
    poses = (Poses(x.pose.R_WB[None], x.pose.p_WB_m[None]) for x in (b, a))
    back, there = next(poses), next(poses)
    xi = se3.log(se3.compose(se3.inverse(back), there))[0]
    sigma = [np.sqrt(np.concatenate((np.diag(x.P), np.diag(x.P_u)[:3]))) for x in (a, b)]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = sigma[0] / sigma[1]
        in_sigmas = np.abs(xi) / sigma[1][:6]
    least = tuple(least_pivot(P) for P in (a.P, a.P_u[:3, :3], b.P, b.P_u[:3, :3]))
    apart = (float(np.linalg.norm(xi[:3])), float(np.linalg.norm(xi[3:])))
    ratios = (float(np.nanmax(ratio)), float(np.nanmin(ratio)))
    worst = float(np.nanmax(in_sigmas))
    return Pair(t_s, *apart, worst, ratios, least, (a.recovered, b.recovered))


def line(pair: Pair) -> str:
    """Returns a line of the table."""
    least = " ".join(f"{x:8.1e}" for x in pair.least)
    both = zip(("f32", "f64"), pair.recovered, strict=True)
    told = " ".join(f"{precision} diverged" for precision, is_so in both if is_so)
    return (
        f"{pair.t_s:8.3f} {pair.apart_m:9.2e} {pair.apart_rad:9.2e} {pair.in_sigmas:9.2e} "
        f"{pair.ratio[0]:7.3f} {pair.ratio[1]:7.3f}  {least}  {told}"
    )


def summary(pairs: Sequence[Pair]) -> str:
    """Returns the figures of the whole drive."""
    first = next((pair.t_s for pair in pairs if pair.parted), None)
    worst = max(pairs, key=lambda pair: pair.in_sigmas)
    least = [min(pair.least[k] for pair in pairs) for k in range(4)]
    diverged = [sum(pair.recovered[k] for pair in pairs) for k in range(2)]
    parted = "never" if first is None else f"first at {first:.3f} s"
    return (
        f"{len(pairs)} frames; diverged: float32 {diverged[0]}, float64 {diverged[1]} times\n"
        f"apart by more than {PARTED} sigma: {parted}, in {sum(p.parted for p in pairs)} frames\n"
        f"worst: {worst.apart_m:.2e} m, {worst.apart_rad:.2e} rad, {worst.in_sigmas:.2e} sigmas at "
        f"{worst.t_s:.3f} s\n"
        f"least pivot: pose {least[0]:.1e} and {least[2]:.1e} in float64, "
        f"velocity {least[1]:.1e} and {least[3]:.1e}"
    )


def main() -> None:
    """Replays twice and prints."""
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--every", type=int, default=0, help="a line for each so many frames")
    parser.add_argument("--only-parted", action="store_true", help="and for those that part")
    given = parser.parse_args(words[:cut])
    both = [
        dict(frames_of(run(given.bin / p, given.recording, words[cut + 1 :]))) for p in PROGRAMS
    ]
    times = sorted(both[0].keys() & both[1].keys())
    if not times:
        sys.exit(f"{given.recording}: no frame with an estimate in both precisions")
    pairs = [compared(both[0][t], both[1][t], 1e-9 * (t - times[0])) for t in times]
    print(summary(pairs))
    shown = [
        pair
        for k, pair in enumerate(pairs)
        if (given.every and k % given.every == 0) or (given.only_parted and pair.parted)
    ]
    if shown:
        print(
            "       t   apart m       rad in sigmas    sigma32/64   least: pose, v; pose, v of f64"
        )
    for pair in shown:
        print(line(pair))


if __name__ == "__main__":
    main()
