# SPDX-License-Identifier: MIT
"""The report in words, for terminal and page: the runs, and what is wrong with them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from pelorus.report.comparison import Comparison, Run
from pelorus.wire import schema
from pelorus.wire.frames import Header

NONE = "-"
POSE = ("err0 m", "ATE m", "rotation deg", "NEES/6")
MAP = ("map m", "NEES/3")
MAP_KEYS = ("map_rms_m", "map_nees_per_dof")
USE = ("used", "gated", "times real time")
POSE_KEYS = ("err0_m", "ate_m", "rot_deg", "nees_per_dof")


def titles(compared: Comparison) -> tuple[str, ...]:
    """Returns the titles; the map's columns only where the recording has known landmarks."""
    return ("run", *POSE, *(MAP if compared.subject.known else ()), *USE)


def row(compared: Comparison, run: Run) -> tuple[str, ...]:
    """Returns the cells in the order of the titles. In mapping the poses are given, without
    error.
    """
    summary = run.summary
    keys = (*POSE_KEYS, *(MAP_KEYS if compared.subject.known else ()))
    use = (str(summary["used"]), str(summary["gated"]), _factor(summary["realtime_factor"]))
    return (run.name, *(number(summary[key]) for key in keys), *use)


def number(value: Any) -> str:
    """Returns three digits, and no more than millimetres."""
    if value is None:
        return NONE
    if abs(value) >= 1e5:
        return f"{value:.2e}"
    return f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"


def _factor(value: Any) -> str:
    if value is None:
        return NONE
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


# --- what is off ----------------------------------------------------------------------------------

GATE_LOCKED, GATE_INERT, NIS_HIGH, NOT_POSITIVE = (
    schema.number("reason", name)
    for name in ("GATE_LOCKED", "GATE_INERT", "NIS_HIGH", "NOT_POSITIVE")
)
NEES_HIGH = 2.0
FRAMES_ENOUGH = 20  # with fewer, a mean NEES means nothing
GATED_MANY = 0.2  # of the matched observations
LOST_MANY = 0.02  # of the frames
INERT_MANY = 0.05  # of the frames
NO_ROOM_MANY = 0.05  # of the observations
NIS_HIGH_MANY = 0.2  # of the frames


def remarks(compared: Comparison) -> list[str]:
    """Returns a line for each fault of a run, beyond the verdict; none for dead reckoning."""
    dead_reckoning = compared.run("dead-reckoning")
    lines = [
        line
        for run in compared.runs
        if run is not dead_reckoning
        for line in _of_run(run, dead_reckoning, compared)
    ]
    return [*lines, *_of_recording(compared)]


def _of_recording(compared: Comparison) -> Iterator[str]:
    if not compared.accuracy:
        yield "The recording has no truth at its frames: errors and NEES cannot be given."
    elif compared.main.summary["truth_frames"] < FRAMES_ENOUGH:
        yield "Too few frames have truth to judge errors and NEES by."
    if compared.main.summary["bias"] == "off" and _suggests_bias(compared.subject.header):
        yield (
            "The recording's header tells of biases of the twist, and the settings turn their "
            "estimation off: try --set bias=on."
        )
    said = {line.partition(": ")[2] or line: None for run in compared.runs for line in run.said}
    yield from (f"The replay says: {line}." for line in said)


def _suggests_bias(header: Header) -> bool:
    return max(header.noise.bias_velocity_sigma_mps, header.noise.bias_gyro_sigma_radps) > 0


def _of_run(run: Run, dead_reckoning: Run, compared: Comparison) -> Iterator[str]:
    """Yields the remarks on a run; for the user's own without what its verdict says."""
    checks = [_frames(run), *([_map(run)] if run.poses_given else []), _gate(run), _room(run)]
    if run is not compared.main:
        checks += [_health(run, compared.origin_ns), _consistency(run), _noise(run)]
    for check in (*checks, _use(run, dead_reckoning)):
        yield from (f"{run.name}: {line}" for line in check)


def _health(run: Run, origin_ns: int) -> Iterator[str]:
    diverged = np.nonzero(run.frames.reasons & NOT_POSITIVE)[0]
    if len(diverged):
        t_s = (int(run.frames.t_ns[diverged[0]]) - origin_ns) * 1e-9
        yield (
            f"diverged at t = {t_s:.1f} s: a variance ceased to be "
            "positive; the filter went on from its pose and dropped its landmarks."
        )
    lost, frames = run.summary["frames_lost"], run.summary["frames"]
    if lost > LOST_MANY * frames:
        yield f"lost in {lost} of {frames} frames: nothing was used in the ten before each."


def _frames(run: Run) -> Iterator[str]:
    refused = run.summary["frames_refused"]
    if refused:
        yield f"{refused} of {refused + run.summary['frames']} frames were refused."
    factor = run.summary["realtime_factor"]
    if factor is not None and 0 < factor < 1:
        yield f"slower than real time on this machine: {factor:.2g} times."


def _consistency(run: Run) -> Iterator[str]:
    if run.summary["truth_frames"] < FRAMES_ENOUGH:
        return
    if run.poses_given:
        return
    nees = run.summary["nees_per_dof"]
    left_out = run.summary["nees_left_out"]
    if left_out:
        yield f"{left_out} frames have a covariance that is not positive; NEES leaves them out."
    if nees is not None and nees > NEES_HIGH:
        yield (
            f"believes more than it knows: NEES/6 is {nees:.3g} where 1 is expected, so its errors "
            f"are about {math.sqrt(nees):.2g} times as large as it says."
        )


def _map(run: Run) -> Iterator[str]:
    """Yields remarks on the map, which is what was estimated where the poses are given."""
    found = run.summary
    if not found["map_landmarks"]:
        yield "its poses were given, and the recording knows no landmarks: nothing to compare."
        return
    yield (
        f"its poses were given; the map of {found['map_landmarks']} landmarks is "
        f"{found['map_rms_m']:.3f} m RMS off, {found['map_median_m']:.3f} m median."
    )
    nees = found["map_nees_per_dof"]
    if nees is not None and nees > NEES_HIGH:
        yield (
            f"the map believes more than it knows: NEES/3 is {nees:.3g} where 1 is expected. "
            "Given poses and calibration have errors too, which do not average out."
        )


def _gate(run: Run) -> Iterator[str]:
    reasons = run.frames.reasons
    locked = int(np.count_nonzero(reasons & GATE_LOCKED))
    if locked:
        yield f"gate locked in {locked} frames: most matches were rejected, the landmarks dropped."


def _noise(run: Run) -> Iterator[str]:
    reasons = run.frames.reasons
    inert = int(np.count_nonzero(reasons & GATE_INERT))
    if inert > INERT_MANY * len(reasons):
        yield f"gate inert in {inert} frames: it rejected none of the last 1000 matches. Too wide?"
    gated, matched = run.summary["gated"], run.summary["matched"]
    if matched and gated > GATED_MANY * matched:
        yield (
            f"the gate rejects {gated / matched:.0%} of the matches: noise set too small, wrong "
            "tracks, or a wrong estimate."
        )
    high = int(np.count_nonzero(reasons & NIS_HIGH))
    if high > NIS_HIGH_MANY * len(reasons):
        yield f"innovations larger than the noise explains in {high} of {len(reasons)} frames."


def _room(run: Run) -> Iterator[str]:
    no_room, observations = run.summary["no_room"], run.summary["observations"]
    if no_room > NO_ROOM_MANY * observations:
        yield (
            f"{no_room} of {observations} observations found no slot: raise --set slots=N "
            f"(now {run.summary['slots']})."
        )


def _use(run: Run, dead_reckoning: Run) -> Iterator[str]:
    """Yields a remark if a filter does no better than the twists alone."""
    ate, without = run.summary["ate_m"], dead_reckoning.summary["ate_m"]
    if run is dead_reckoning or run.summary["truth_frames"] < FRAMES_ENOUGH:
        return
    if ate is not None and without is not None and ate > without:
        yield f"no better than dead reckoning: ATE {ate:.3g} m against {without:.3g} m."
