# SPDX-License-Identifier: MIT
"""Finds twist timing, clock offset, biases and noises of a recording by maximum likelihood.

A further parameter must gain more likelihood than chance would. Where the tracks drift, the
likelihood of single steps misses the long errors (tracks_noise.py): then pixel-sigma is the one
that covers the drift, and the twists' sigmas stay as given, but no larger than the images allow.
Whether the result is better than the given settings is tested afterwards (held.py).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pelorus.check import calibration, clock, slots, tuning_imu
from pelorus.check.biases import WIDE, biases_by_halves, gyro_bias_in_drift
from pelorus.check.options import Settings
from pelorus.check.outcome import LENGTH, OFFSET, SCALE, Bench
from pelorus.check.parameters import (
    AXES,
    PAYS,
    TWIST,
    Tuned,
    merged,
    offset_settings,
    pooled,
    starting,
    written,
)
from pelorus.check.search import COARSE, COARSE_FRAMES, BestFound, search_noises
from pelorus.check.tracks_noise import DRIFT, TrackNoise, differs_clearly, track_noise
from pelorus.converters.twist_noise import TwistSpread, difference_of_a_reading
from pelorus.faults.agreement import Agreement

SPREAD_FRAMES = 20  # enough to measure a spread to a fifth, as a start
FINE = (1.3, 1.15)
TWO_CLOCKS = "no timing suits velocities and rates of turn of two clocks: yours stays"
ALIKE = "one sigma for all axes"
OF_AXES = (2.0, 1.5)  # factors from one sigma for all axes to one for each


def tune(bench: Bench, given: Settings, agreed: Agreement | None, one_clock: bool = True) -> Tuned:
    """Finds the settings of a recording.

    `given` holds wherever nothing better is found. `agreed` is how far camera and body agree, if
    that is known: where the search for the clock begins. `one_clock`: velocities and rates of turn
    share a clock; otherwise no offset suits both.
    """
    if bench.by_imu:
        return tuning_imu.tune(bench, given, clock.of_fit(agreed))
    return _tune(bench, given, agreed, one_clock)


def _tune(bench: Bench, given: Settings, agreed: Agreement | None, one_clock: bool) -> Tuned:
    before = bench.run(given)
    noise = track_noise(bench.examined)
    start = starting(bench.header, given, TWIST)
    names = tuple(parameter.setting for parameter in TWIST.values())
    fixed = {k: v for k, v in given.items() if not k.startswith(names)}
    fixed[OFFSET] = fixed.pop("camera-offset", "0")
    if noise.drifts:
        fixed.pop(DRIFT, None)  # the biases that one step shows are estimated without drift
        found = _of_drifting_tracks(bench, fixed, start, noise)
        shared_px = noise.rows.shared_px if noise.rows is not None else 0.0
        fixed, words = gyro_bias_in_drift(bench, fixed, found.values, shared_px)
        offset_s = float(fixed.pop(OFFSET))
        fixed |= noise.setting(given)
        settings = fixed | written(found.values, TWIST) | offset_settings(offset_s)
        return Tuned(settings, before, bench.run(settings), noise, [words])
    rough = fixed | WIDE | slots.fewer(given)
    values = _roughly(bench, rough | {LENGTH: COARSE_FRAMES}, start)
    offset = _by_fit(bench, given, agreed) if one_clock else clock.UNTOLD
    if one_clock and not offset.is_near:
        offset = clock.of_twists(bench, rough | written(values, TWIST))
    if offset.gain_over(float(rough[OFFSET])) > PAYS:  # a wrong clock is no noise: it comes first
        rough[OFFSET] = f"{offset.best_s:.6f}"
        values = search_noises(bench, rough | {LENGTH: COARSE_FRAMES}, values, TWIST, COARSE).values
    moved = fixed | WIDE | {OFFSET: rough[OFFSET]}
    values = search_noises(bench, moved, values, TWIST, (1.5, 1.25)).values
    fixed, of_bias = biases_by_halves(bench, moved, values)
    off = calibration.scale_off_by(agreed)
    if one_clock:
        about_s = offset.best_s if np.isfinite(offset.sigma_s) else None
        fixed, found, of_clock = clocked(bench, fixed, values, given, off, about_s)
    else:
        found, of_clock = search_noises(bench, fixed, values, TWIST, FINE), TWO_CLOCKS
    found, of_axes = _axes(bench, fixed, found)
    offset_s = float(fixed.pop(OFFSET))
    settings = merged(fixed | written(found.values, TWIST)) | offset_settings(offset_s)
    said = [of_bias, of_clock, of_axes]
    lasting = [calibration.scale_words(off)] if off else []
    outcome = found.outcome
    return Tuned(settings, before, outcome, noise, said, offset_s, [of_clock], lasting=lasting)


def _by_fit(bench: Bench, given: Settings, agreed: Agreement | None) -> clock.Offset:
    """Returns the fit's offset where replays could tell one, and read the twists as the fit did.

    The fit goes by the HEADER's timing. With one twist a frame another timing is another offset,
    and a wrong one would be made up for before the timings compete.
    """
    timing = bench.header.twist_timing.name.lower()
    if not clock.is_finer(bench) or given.get("twist-timing", timing) != timing:
        return clock.UNTOLD
    return clock.of_fit(agreed)


def _roughly(bench: Bench, side: Settings, start: Mapping[str, float]) -> dict[str, float]:
    """Returns the likelier of two starts: the given noises, and those that the images show.

    With sigmas that are far too small a filter finds contradictions throughout and widens its
    covariance, which can be a local optimum many steps wide.
    """
    starts = [start]
    most = difference_of_a_reading(bench.examined, SPREAD_FRAMES)
    if most is not None:
        starts.append(dict(start) | _of_twists(start, most))
    found = [search_noises(bench, side, some, TWIST, COARSE) for some in starts]
    return min(found, key=lambda some: some.outcome.cost).values


def _of_twists(start: Mapping[str, float], spread: TwistSpread) -> dict[str, float]:
    """Returns the twists' sigmas alone, as the images show them."""
    said = {"velocity": spread.velocity_mps, "gyro": spread.gyro_radps}
    of = {name: said.get(name.partition("-")[0], 0.0) for name in start}
    return {name: value for name, value in of.items() if value > 0}


# --- tracks that drift ----------------------------------------------------------------------------


def _of_drifting_tracks(
    bench: Bench, fixed: Settings, start: Mapping[str, float], noise: TrackNoise
) -> BestFound:
    """Keeps given sigmas unless the data contradict them; takes pixel-sigma from the tracks."""
    values = dict(start)
    if differs_clearly(noise.stands_for_px, start["pixel"]):
        values["pixel"] = float(f"{noise.stands_for_px:.3g}")
    most = difference_of_a_reading(bench.examined)
    if most is not None:
        for name, value in _of_twists(start, most).items():
            if value < start[name] and differs_clearly(value, start[name]):
                values[name] = value
    return BestFound(values, bench.run({**fixed, **written(values, TWIST)}))


# --- clocks ---------------------------------------------------------------------------------------


def clocked(
    bench: Bench,
    fixed: Settings,
    values: Mapping[str, float],
    given: Settings,
    off: float = 0.0,
    about_s: float | None = None,
) -> tuple[dict[str, str], BestFound, str]:
    """Returns timing and offset of the camera's clock as settings, the noises again if these
    change, and words.

    With several readings a frame the offset covers both: another timing is a shift by a whole
    reading. With a single one the timings are tried; `mid` competes only if it is given, for it
    averages two readings and would win by its smaller noise alone. `off` is the known scale error
    of the velocities, which must not be taken for a clock; `about_s` what is roughly known.
    """
    was_s = float(given.get("camera-offset", "0"))
    timing = fixed.get("twist-timing", bench.header.twist_timing.name.lower())
    side = {**fixed, **written(values, TWIST), "twist-timing": timing, SCALE: f"{1 + off:.4f}"}
    offset = clock.of_twists(bench, side, about_s)
    settings = {**fixed, "twist-timing": timing, OFFSET: f"{was_s:.6f}"}
    if np.isfinite(offset.sigma_s):
        words = f"twist-timing {timing}: no offset of the camera's clock is likelier than yours "
        words += f"(known to {2e3 * offset.sigma_s:.2g} ms)"
        if offset.gain_over(was_s) > PAYS:
            settings, words = _moved(bench, settings, offset, timing)
    else:
        words = f"twist-timing {timing} is the likeliest"
        others = [name for name in ("start", "end") if name != timing]
        ran = bench.run_all([side, *({**side, "twist-timing": name} for name in others)], "timing")
        best = min(range(len(ran)), key=lambda k: ran[k].cost)
        if ran[best].gain_over(ran[0]) > PAYS:
            settings["twist-timing"] = others[best - 1]
            gain = ran[best].gain_over(ran[0])
            words = f"twist-timing is {others[best - 1]}, not {timing} (likelihood {gain:+.0f})"
    return settings, search_noises(bench, settings, values, TWIST, FINE), words


def _moved(
    bench: Bench, settings: Settings, offset: clock.Offset, timing: str
) -> tuple[dict[str, str], str]:
    """Returns the settings with the offset, or with the timing that moves the readings as far."""
    period_s = clock.seconds(bench.examined.twist_t_ns)
    near_s = max(3 * offset.sigma_s, 0.25 * period_s)
    gain = offset.gain_over(0.0)
    for name in ("start", "end"):
        as_far_s = (clock.MIDDLES[timing] - clock.MIDDLES[name]) * period_s
        if name != timing and abs(offset.best_s - as_far_s) < near_s:
            words = f"twist-timing is {name}, not {timing} (likelihood {gain:+.0f}), or the "
            words += f"camera's clock is {abs(as_far_s) * 1e3:.0f} ms off: one is like the other"
            return {**settings, "twist-timing": name, OFFSET: "0"}, words
    late = "late" if offset.best_s < 0 else "early"
    words = (
        f"the camera's clock is {abs(offset.best_s) * 1e3:.0f} ms {late} beside that of the "
        f"twists, known to {2e3 * offset.sigma_s:.2g} ms (likelihood {gain:+.0f})"
    )
    return {**settings, OFFSET: f"{offset.best_s:.6f}"}, words


# --- axes -----------------------------------------------------------------------------------------


def _axes(bench: Bench, fixed: Settings, found: BestFound) -> tuple[BestFound, str]:
    """Returns a sigma for each axis where that pays: two parameters more for each kind.

    Few landmarks tell first whether the axes differ at all: from one sigma for all, sigmas of their
    own gain at most a few where they do not, and hundreds where they do.
    """
    split = {"pixel": found.values["pixel"]}
    for name in ("velocity", "gyro"):
        for axis in AXES:
            key = f"{name}-{axis}"
            split[key] = found.values[key] if key in found.values else found.values[name]
    few = {**fixed, **slots.fewer(fixed)}
    one_for_all = bench.run({**few, **written(split, TWIST)})
    rough = search_noises(bench, few, split, TWIST, OF_AXES[:1], "noise by axis")
    observations = found.outcome.matched / max(rough.outcome.matched, 1)
    if rough.outcome.gain_over(one_for_all) * observations < PAYS:
        return found, ALIKE
    rough = search_noises(bench, few, rough.values, TWIST, OF_AXES[1:], "noise by axis")
    result = search_noises(bench, fixed, rough.values, TWIST, FINE[1:], "noise by axis")
    said = []
    for name in ("velocity", "gyro"):
        alike = {k: v for k, v in result.values.items() if not k.startswith(name)}
        alike |= {name: pooled(result.values, name)}
        one = BestFound(alike, bench.run({**fixed, **written(alike, TWIST)}))
        if name in found.values:  # starts from the best value for all axes
            best = {**alike, name: found.values[name]}
            other = BestFound(best, bench.run({**fixed, **written(best, TWIST)}))
            one = min(one, other, key=lambda some: some.outcome.cost)
        gain = result.outcome.gain_over(one.outcome)
        if gain > 2 * PAYS:
            said.append(f"{TWIST[name].setting} by axis (likelihood {gain:+.0f})")
        else:
            result = one
    better = result if result.outcome.cost < found.outcome.cost else found
    return better, ", ".join(said) or ALIKE
