# SPDX-License-Identifier: MIT
"""By how much the camera's clock is off: the offset that makes what was seen likeliest.

About its least, the cost of an offset is a parabola: cost = least + (offset - best)^2 / sigma^2. So
its foot is the offset, and its bend says how well the recording tells it. A single cost jumps
by chance, since each offset brings other readings' noise together in a frame; so the parabola is
laid through many offsets, and not through the best three. How far its foot moves when
parts of the drive are left out, one after the other (the jackknife), says how well they agree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pelorus.check.options import Settings
from pelorus.check.outcome import OFFSET, OFFSET_MOST_S, Bench, Outcome
from pelorus.layout import Floats
from pelorus.motion import Times

FEWEST = 5  # points of a parabola
PARTS = 20  # of the drive, to see how well they agree
COARSE_S = 0.01  # from one offset tried to the next, at least
NEAR_STEPS = 2  # of these, where the offset is roughly known
NEAR_S = 0.04  # to either side of the best of them: farther off it is no parabola
SHRINK = 3.0
# The middle of what a reading stands for, in readings beside its own time, by the timing's name.
MIDDLES = {"start": 0.5, "mid": 0.0, "end": -0.5}
FINEST_S = 2e-5
STEP_SIGMAS = 2.0  # steps of so many sigmas tell the foot best
SURE_OF_PARTS = 0.04  # of a reading: with such a sigma the least is not made by its parts


@dataclass(frozen=True)
class Offset:
    """Seconds to be added to the frames' times; `sigma_s` is infinite if nothing tells it."""

    best_s: float
    sigma_s: float
    bend_s: float = float("inf")  # sigma by the bend alone: finer steps may lie on a parabola

    @property
    def gain(self) -> float:
        """By how much it is likelier than none, -2 ln of the ratio."""
        return (self.best_s / self.sigma_s) ** 2 if self.sigma_s > 0 else 0.0


UNTOLD = Offset(0.0, float("inf"))


def of_twists(bench: Bench, settings: Settings) -> Offset:
    """Moved by whole readings only; untold where there is a single reading a frame.

    An offset by a part of a reading would have each frame average one reading more, and win for the
    smaller noise alone.
    """
    period_s = seconds(bench.examined.twist_t_ns)
    if seconds(bench.examined.frame_t_ns) < 2 * period_s or not period_s > 0:
        return UNTOLD
    step_s = period_s * max(round(COARSE_S / period_s), 1)
    most = int(OFFSET_MOST_S / step_s + 1e-6)
    costs = _costs(bench, settings, 0.0, step_s, most)
    offsets = np.array(list(costs))
    best_s = _best(costs)
    beside = np.sort(np.abs(offsets - best_s))[:FEWEST].max(initial=0.0)
    near = np.abs(offsets - best_s) <= max(NEAR_S, beside) * (1 + 1e-9)
    return foot(offsets[near], np.stack(list(costs.values()))[near])


def of_imu(
    bench: Bench, settings: Settings, about_s: float = 0.0, reach: int | None = None
) -> Offset:
    """Steps that find the valley first, so many to either side, then finer ones that find its foot.

    They are whole readings as long as that is fine enough: where camera and IMU keep one grid, an
    offset by parts of a reading changes how many readings a frame averages, too.
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
    """Two steps to either side of the best that is known; there may be a better one among them."""
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
    """-2 ln of the likelihood of each part of the drive, by offset."""
    offsets = (about_s + k * step_s for k in range(-most, most + 1))
    tried = [float(f"{at:.6f}") for at in offsets if abs(at) <= OFFSET_MOST_S * 1.001]
    ran = bench.run_all([{**settings, OFFSET: f"{at:.6f}"} for at in tried], "clock")
    most = max((outcome.matched for outcome in ran), default=0)
    return {at: of_parts(outcome, most) for at, outcome in zip(tried, ran, strict=True)}


def of_parts(outcome: Outcome, matched: int) -> Floats:
    """As if so many had been matched: no offset may win by what it loses."""
    if not np.isfinite(outcome.cost):
        return np.full(PARTS, np.inf)
    scale = matched / max(outcome.matched, 1)
    return np.array([scale * float(part.sum()) for part in np.array_split(outcome.by_frame, PARTS)])


def foot(offsets: Floats, costs: Floats) -> Offset:
    """Of the parabola through all costs, as far as they are finite and lie about it: one of each
    offset, or a row of those of the drive's parts.
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
    # the foot is as sure as the bend says, but no surer than the points lie on a parabola, and
    # than the drive's parts agree on it
    off = float(np.sum((up - np.polyval((bend, slope, least), across)) ** 2)) / max(len(x) - 3, 1)
    variance = 1 / bend + off / float(np.sum(across**2)) / (2 * bend) ** 2
    variance = max(variance, _by_parts(across, parts))
    bend_s = scale / float(np.sqrt(bend))
    return Offset(middle + best * scale, scale * float(np.sqrt(variance)), bend_s)


def _by_parts(across: Floats, parts: Floats) -> float:
    """The jackknife's variance of the foot; 0 where there are no parts."""
    count = parts.shape[1]
    if count < 2:
        return 0.0
    rest = parts.sum(axis=1, keepdims=True) - parts
    bend, slope, _ = np.polyfit(across, rest - rest.min(axis=0), 2)
    feet = -slope[bend > 0] / (2 * bend[bend > 0])
    return float((count - 1) * np.var(feet)) if len(feet) == count else float("inf")


def seconds(t_ns: Times) -> float:
    """From one to the next, usually."""
    return float(np.median(np.diff(t_ns))) * 1e-9 if len(t_ns) > 2 else 0.0
