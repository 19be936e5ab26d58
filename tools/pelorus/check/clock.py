# SPDX-License-Identifier: MIT
"""Finds by how much the camera's clock is off: the offset with the greatest likelihood.

Near its minimum the cost of an offset is a parabola: cost = least + (offset - best)^2 / sigma^2.
Its vertex is the offset, and its curvature gives the standard error. A single cost jumps by chance,
since each offset averages other readings in a frame; so the parabola is fitted to many offsets, not
to the best three. How far the vertex moves when parts of the drive are left out in turn (the
jackknife) says how well the parts agree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pelorus.check.options import Settings
from pelorus.check.outcome import OFFSET, OFFSET_MOST_S, Bench, Outcome
from pelorus.faults.agreement import Agreement
from pelorus.math.motion import Times
from pelorus.wire.layout import Floats

FEWEST = 5  # points of a parabola
PARTS = 20  # of the drive, for the jackknife
COARSE_S = 0.01  # least step between two offsets that are tried
NEAR_STEPS = 2  # so many steps where the offset is roughly known
NEAR_S = 0.04  # to either side of the best one; farther off the cost is no parabola
SHRINK = 3.0
SURE = 4.0  # sigmas
# Middle of the interval that a reading describes, in intervals after its stamp, by timing.
MIDDLES = {"start": 0.5, "mid": 0.0, "end": -0.5}
FINEST_S = 2e-5
STEP_SIGMAS = 2.0  # a step of so many sigmas locates the vertex best
SURE_OF_PARTS = 0.04  # of a reading's interval: a smaller sigma is no artefact of averaging


@dataclass(frozen=True)
class Offset:
    """Seconds to add to the frames' times; `sigma_s` is infinite if nothing is known."""

    best_s: float
    sigma_s: float
    bend_s: float = float("inf")  # sigma by the curvature alone

    @property
    def is_near(self) -> bool:
        """Returns whether the truth is that near that offsets about this one suffice."""
        return SURE * self.sigma_s < NEAR_S

    def gain_over(self, was_s: float) -> float:
        """Returns -2 ln of the likelihood ratio against an offset of `was_s`."""
        return ((self.best_s - was_s) / self.sigma_s) ** 2 if self.sigma_s > 0 else 0.0


UNTOLD = Offset(0.0, float("inf"))


def of_fit(agreed: Agreement | None) -> Offset:
    """Returns the offset by the fit over pairs of frames; unknown where that tells none, or one
    that is too large to be tried.

    Replays then tell it better by a third: to a filter a point is known from all frames that saw
    it, to a pair from two.
    """
    if agreed is None or not np.isfinite(agreed.offset_sigma_s):
        return UNTOLD
    if abs(agreed.offset_s) > OFFSET_MOST_S:
        return UNTOLD
    return Offset(agreed.offset_s, agreed.offset_sigma_s)


def surer(one: Offset, other: Offset) -> Offset:
    """Returns that of two estimates which is known better; `other` where both are alike."""
    return one if one.sigma_s < other.sigma_s else other


def is_finer(bench: Bench) -> bool:
    """Returns whether there are several twists a frame, without which they tell no offset."""
    period_s = seconds(bench.examined.twist_t_ns)
    return seconds(bench.examined.frame_t_ns) >= 2 * period_s > 0


def of_twists(bench: Bench, settings: Settings, about_s: float | None = None) -> Offset:
    """Estimates the offset by twists in steps of whole readings; unknown with one reading a frame.

    A fraction of a reading would make each frame average one reading more, and win by the smaller
    noise alone. Where the offset is known roughly (`about_s`), those farther off are tried only if
    the best is not near it.
    """
    if not is_finer(bench):
        return UNTOLD
    period_s = seconds(bench.examined.twist_t_ns)
    step_s = period_s * max(round(COARSE_S / period_s), 1)
    most = int(OFFSET_MOST_S / step_s + 1e-6)
    reach = max(int(NEAR_S / step_s + 1e-6), FEWEST - 1) + 1  # a parabola about a neighbour, too
    middle = None if about_s is None else round(about_s / step_s)
    costs = {} if middle is None else _costs(bench, settings, middle * step_s, step_s, reach)
    if middle is None or abs(_best(costs) / step_s - middle) > 1.5:
        costs = _costs(bench, settings, 0.0, step_s, most)
    offsets = np.array(list(costs))
    best_s = _best(costs)
    beside = np.sort(np.abs(offsets - best_s))[:FEWEST].max(initial=0.0)
    near = np.abs(offsets - best_s) <= max(NEAR_S, beside) * (1 + 1e-9)
    return foot(offsets[near], np.stack(list(costs.values()))[near])


def of_imu(
    bench: Bench, settings: Settings, about_s: float = 0.0, reach: int | None = None
) -> Offset:
    """Estimates the offset by an IMU: coarse steps find the valley, finer ones its vertex.

    Steps are whole readings as long as that is fine enough. Where camera and IMU share one time
    grid, a fraction of a reading changes how many readings a frame averages.
    """
    period_s = seconds(bench.examined.inertial.t_ns)
    if not period_s > 0:
        return UNTOLD
    step_s = period_s * max(round(COARSE_S / period_s), 1)
    most = int(OFFSET_MOST_S / step_s + 1e-6) if reach is None else reach
    costs = _costs(bench, settings, about_s, step_s, most)
    while True:
        found, costs = _valley(bench, settings, costs, step_s)
        if np.isfinite(found.bend_s) and step_s <= STEP_SIGMAS * SHRINK * found.bend_s:
            return found
        whole = step_s > 1.5 * period_s
        unsure = not whole and found.bend_s > SURE_OF_PARTS * period_s
        if unsure or step_s <= FINEST_S:
            return found
        finer_s = step_s / SHRINK
        step_s = period_s * max(round(finer_s / period_s), 1) if whole else max(finer_s, FINEST_S)


def _valley(
    bench: Bench, settings: Settings, costs: dict[float, Floats], step_s: float
) -> tuple[Offset, dict[float, Floats]]:
    """Refines two steps to either side of the best known offset, for there may be a better one."""
    tried = -1
    while tried < len(costs):
        tried = len(costs)
        best_s = _best(costs)
        costs = costs | _costs(bench, settings, best_s, step_s, 2)
    near = [offset for offset in costs if abs(offset - best_s) < 2.5 * step_s]
    return foot(np.array(near), np.stack([costs[offset] for offset in near])), costs


def _best(costs: dict[float, Floats]) -> float:
    return min(costs, key=lambda offset: float(costs[offset].sum()))


def _costs(
    bench: Bench, settings: Settings, about_s: float, step_s: float, most: int
) -> dict[float, Floats]:
    """Returns -2 ln of the likelihood of each part of the drive, by offset."""
    offsets = (about_s + k * step_s for k in range(-most, most + 1))
    tried = [float(f"{at:.6f}") for at in offsets if abs(at) <= OFFSET_MOST_S * 1.001]
    ran = bench.run_all([{**settings, OFFSET: f"{at:.6f}"} for at in tried], "clock")
    most = max((outcome.matched for outcome in ran), default=0)
    return {at: of_parts(outcome, most) for at, outcome in zip(tried, ran, strict=True)}


def of_parts(outcome: Outcome, matched: int) -> Floats:
    """Returns costs as if `matched` observations had been used, so that losing some gains
    nothing.
    """
    if not np.isfinite(outcome.cost):
        return np.full(PARTS, np.inf)
    scale = matched / max(outcome.matched, 1)
    return np.array([scale * float(part.sum()) for part in np.array_split(outcome.by_frame, PARTS)])


def foot(offsets: Floats, costs: Floats) -> Offset:
    """Fits a parabola to all finite costs near the minimum, and returns its vertex and standard
    error.

    `costs` has one value for each offset, or a row of the values of the drive's parts.
    """
    parts = costs.reshape(len(offsets), -1)
    good = np.isfinite(parts).all(axis=1)
    x, parts = offsets[good], parts[good]
    if len(x) < FEWEST - 2:
        return UNTOLD
    y = parts.sum(axis=1)
    middle, scale = float(x[np.argmin(y)]), float(np.ptp(x)) / 2 or 1.0
    across, up = (x - middle) / scale, y - y.min()
    bend, slope, least = np.polyfit(across, up, 2)
    if not bend > 0:
        return UNTOLD
    best = float(np.clip(-slope / (2 * bend), -1.0, 1.0))
    # The curvature gives the sigma, enlarged by the residuals from the parabola and by the
    # disagreement of the drive's parts.
    off = float(np.sum((up - np.polyval((bend, slope, least), across)) ** 2)) / max(len(x) - 3, 1)
    variance = 1 / bend + off / float(np.sum(across**2)) / (2 * bend) ** 2
    variance = max(variance, _by_parts(across, parts))
    bend_s = scale / float(np.sqrt(bend))
    return Offset(middle + best * scale, scale * float(np.sqrt(variance)), bend_s)


def _by_parts(across: Floats, parts: Floats) -> float:
    """Returns the jackknife variance of the vertex; 0 where there are no parts."""
    count = parts.shape[1]
    if count < 2:
        return 0.0
    rest = parts.sum(axis=1, keepdims=True) - parts
    bend, slope, _ = np.polyfit(across, rest - rest.min(axis=0), 2)
    feet = -slope[bend > 0] / (2 * bend[bend > 0])
    return float((count - 1) * np.var(feet)) if len(feet) == count else float("inf")


def seconds(t_ns: Times) -> float:
    """Returns the median interval between two times, seconds."""
    return float(np.median(np.diff(t_ns))) * 1e-9 if len(t_ns) > 2 else 0.0
