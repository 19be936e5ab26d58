# SPDX-License-Identifier: MIT
"""Finds noises, walks, timing and clock of a recording with an IMU by maximum likelihood.

A wrong clock looks like noise, and small noise hides the valley in which the clock's offset lies: a
filter that trusts its IMU takes frames of another time for a contradiction and widens its
covariance. So the noises come first, as large as the wrong clock makes them, then the clock, and
then both again; where the fit over pairs of frames tells the clock, that comes first.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pelorus.check import clock, slots
from pelorus.check.options import Settings
from pelorus.check.outcome import LENGTH, OFFSET, Bench, Outcome
from pelorus.check.parameters import (
    IMU,
    PAYS,
    PIXEL,
    WALKS,
    Parameter,
    Tuned,
    merged,
    offset_settings,
    starting,
    written,
)
from pelorus.check.search import COARSE, COARSE_FRAMES, BestFound, search_noises
from pelorus.check.tracks_noise import TrackNoise, differs_clearly, track_noise
from pelorus.evaluate.inertial_survey import scatter

LOOSE = 10.0  # factor of the noises while the clock is far off
MIDDLE = (2.0, 2.0, 1.5)  # the whole drive with few landmarks, once the clock is about right
FINE = (1.5, 1.2)
WALK_STEPS = (4.0, 2.0)
TOLD = 9.0  # -2 ln of the likelihood ratio: 3 sigma, to either side
TOLD_FACTOR = 3.0


def tune(bench: Bench, given: Settings, of_fit: clock.Offset) -> Tuned:
    """Finds the settings of a recording with an IMU; `given` holds unless others are better.

    `of_fit` is the camera's clock by the fit, if that tells one.
    """
    before = bench.run(given)
    noise = track_noise(bench.examined)
    values = start = starting(bench.header, given, IMU | WALKS)
    side = {k: v for k, v in given.items() if k not in _settings()}
    side[OFFSET] = side.pop("camera-offset", "0")
    said: list[str] = []
    if noise.drifts:
        return _of_drifting_tracks(bench, side, values, before, noise, of_fit)
    walks = {name: start[name] for name in WALKS}
    values = {name: start[name] for name in IMU}
    side |= written(walks, WALKS)
    values, offset = _roughly(bench, side, values, of_fit)
    side[OFFSET] = f"{offset.best_s:.6f}"
    values = search_noises(bench, side | slots.fewer(given), values, IMU, MIDDLE).values
    ran = clock.of_imu(bench, side | written(values, IMU), offset.best_s, clock.NEAR_STEPS)
    offset = clock.surer(of_fit, ran)
    side, words = _clock(side | written(values, IMU), offset, given)
    said.append(words)
    side, words = _walks(bench, side, walks)
    found = _at_least_scatter(bench, side, search_noises(bench, side, values, IMU, FINE))
    said.append(words)
    found, words = noises(bench, side, found, start)
    said.append(words)
    side, outcome, words = _timing(bench, side | written(found.values, IMU), found.outcome, offset)
    said.append(words)
    offset_s = float(side.pop(OFFSET))
    settings = merged(side) | offset_settings(offset_s)
    return Tuned(settings, before, outcome, noise, said, offset_s, [said[0], words])


def _settings() -> set[str]:
    return {parameter.setting for parameter in (*IMU.values(), *WALKS.values())}


# --- clock ----------------------------------------------------------------------------------------


def _roughly(
    bench: Bench, side: Settings, values: Mapping[str, float], of_fit: clock.Offset
) -> tuple[dict[str, float], clock.Offset]:
    """Searches noises and, where the fit does not tell it, the clock in turn, with few landmarks.

    The noises use the drive's beginning. The clock is searched with larger IMU noises, which widen
    the valley of its cost.
    """
    was_s = float(side[OFFSET])
    short = {**side, **slots.fewer(side), LENGTH: COARSE_FRAMES}
    if of_fit.is_near:
        offset = of_fit if of_fit.gain_over(was_s) > PAYS else replace(of_fit, best_s=was_s)
        short[OFFSET] = f"{offset.best_s:.6f}"
        return search_noises(bench, short, values, IMU, COARSE).values, offset
    coarse = search_noises(bench, short, values, IMU, COARSE).values
    loose = {name: LOOSE * max(coarse[name], values[name]) for name in ("gyro", "accel")}
    loose["pixel"] = coarse["pixel"]
    rough = {**side, **slots.fewer(side), **written(loose, IMU)}
    offset = clock.of_imu(bench, rough, was_s)
    if offset.gain_over(was_s) > PAYS:
        short[OFFSET] = f"{offset.best_s:.6f}"
        coarse = search_noises(bench, short, coarse, IMU, COARSE).values
    else:
        offset = replace(offset, best_s=was_s)
    return coarse, offset


def _clock(side: Settings, offset: clock.Offset, given: Settings) -> tuple[dict[str, str], str]:
    """Returns the found offset, if it is clearly likelier than the given one, and words."""
    was_s = float(given.get("camera-offset", "0"))
    known = f"known to {2e3 * offset.sigma_s:.2g} ms" if np.isfinite(offset.sigma_s) else "untold"
    # by the parabola: a single cost depends on how many readings a frame averages
    gain = offset.gain_over(was_s)
    if gain < PAYS:
        here = {**side, OFFSET: f"{was_s:.6f}"}
        return here, f"the clocks of camera and IMU agree as they are set ({known})"
    late = "late" if offset.best_s < 0 else "early"
    return {**side, OFFSET: f"{offset.best_s:.6f}"}, (
        f"the camera's clock is {abs(offset.best_s) * 1e3:.3g} ms {late} beside that of the IMU, "
        f"{known} (likelihood {gain:+.0f})"
    )


def _timing(
    bench: Bench, settings: Settings, usual: Outcome, offset: clock.Offset
) -> tuple[dict[str, str], Outcome, str]:
    """Returns the timing of the readings, its outcome and words.

    Another timing is an offset by part of a reading. It differs only in whether the mean of two
    readings fits better than one, a small effect that shows only where the clock is known to a
    small part of a reading.
    """
    period_s = clock.seconds(bench.examined.inertial.t_ns)
    given = settings.get("imu-timing", "mid")
    if offset.sigma_s > clock.SURE_OF_PARTS * period_s:
        words = f"imu-timing {given}: this drive cannot tell it from an offset by half a reading"
        return dict(settings), usual, words
    tried = {
        name: {
            **settings,
            "imu-timing": name,
            OFFSET: f"{float(settings[OFFSET]) + (middle - clock.MIDDLES[given]) * period_s:.6f}",
        }
        for name, middle in clock.MIDDLES.items()
        if name != given
    }
    ran = dict(zip(tried, bench.run_all(list(tried.values()), "timing"), strict=True))
    best = min(ran, key=lambda name: ran[name].cost)
    gain = ran[best].gain_over(usual)
    if gain < PAYS:
        return dict(settings), usual, f"imu-timing {given} is the likeliest"
    words = f"imu-timing is {best}, not {given} (likelihood {gain:+.0f})"
    return tried[best], ran[best], words


# --- walks ----------------------------------------------------------------------------------------


def _walks(bench: Bench, side: Settings, given: Mapping[str, float]) -> tuple[dict[str, str], str]:
    """Returns how fast the biases wander, where the drive is long enough to show it, and words."""
    quick = {**side, **slots.fewer(side)}
    found = search_noises(bench, quick, given, WALKS, WALK_STEPS)
    kept = dict(given)
    for name in WALKS:
        alone = bench.run({**quick, **written({**found.values, name: given[name]}, WALKS)})
        if found.outcome.gain_over(alone) > PAYS:
            kept[name] = found.values[name]
    untold = _untold(bench, quick, found, WALKS)
    said = "gyro-walk and accel-walk are told by the drive"
    if untold:
        said = f"{_of_drive(untold)}: hours at rest would (Allan deviation)"
    return {**side, **written(kept, WALKS)}, said


# --- what a drive does not tell -------------------------------------------------------------------


def _scatter(bench: Bench) -> dict[str, float]:
    """Returns the filter's own least noises by their names in IMU; lower values change nothing."""
    gyro, accel = scatter(bench.examined.inertial)
    return {"gyro": gyro, "accel": accel}


def _at_least_scatter(bench: Bench, side: Settings, found: BestFound) -> BestFound:
    """Raises noises to the filter's own least ones, below which the likelihood is constant."""
    least = _scatter(bench)
    values = {name: max(value, least.get(name, 0.0)) for name, value in found.values.items()}
    if values == found.values:
        return found
    return BestFound(values, bench.run({**side, **written(values, IMU)}))


def _untold(
    bench: Bench, side: Settings, found: BestFound, parameters: Mapping[str, Parameter]
) -> list[str]:
    """Returns the settings for which far larger or smaller values would be about as likely."""
    out = []
    scattered = _scatter(bench) if parameters is IMU else {}
    for name, parameter in parameters.items():
        value, most, least = found.values[name], parameter.most, parameter.least
        sides = [min(value * TOLD_FACTOR, most), max(value / TOLD_FACTOR, least)]
        tried = [{**side, **written({**found.values, name: v}, parameters)} for v in sides]
        above, below = (
            found.outcome.gain_over(one) for one in bench.run_all(tried, "what is told")
        )
        by_readings = value / TOLD_FACTOR < scattered.get(name, 0.0)
        if above <= TOLD or (below <= TOLD and not by_readings):
            out.append(parameter.setting)
    return out


def _of_drive(untold: list[str]) -> str:
    return f"{' and '.join(untold)} cannot be told within {TOLD_FACTOR:g} times by this drive"


def noises(
    bench: Bench, side: Settings, found: BestFound, given: Mapping[str, float]
) -> tuple[BestFound, str]:
    """Keeps a given noise that the drive cannot measure, if it is about as likely and no smaller.

    Trusting an IMU too much is the worse fault. Where the frames measure the motion far better than
    the accelerometer does, or gravity's direction as well as its noise allows, the likelihood
    hardly depends on the noise.
    """
    untold = _untold(bench, side, found, IMU)
    for name, parameter in IMU.items():
        if parameter.setting in untold and given[name] > found.values[name]:
            values = {**found.values, name: given[name]}
            usual = bench.run({**side, **written(values, IMU)})
            if found.outcome.gain_over(usual) < PAYS:
                found = BestFound(values, usual)
    if not untold:
        return found, "pixel-sigma, gyro-noise and accel-noise are told by the drive"
    kept = ", ".join(f"{found.values[n]:.3g}" for n in IMU if IMU[n].setting in untold)
    words = f"{_of_drive(untold)} ({kept} is written): a datasheet or hours at rest tell it"
    return found, words


# --- tracks that drift ----------------------------------------------------------------------------


def _of_drifting_tracks(
    bench: Bench,
    side: Settings,
    values: Mapping[str, float],
    before: Outcome,
    noise: TrackNoise,
    of_fit: clock.Offset,
) -> Tuned:
    """Keeps the IMU's given noises; takes the pixel-sigma that covers the tracks' drift."""
    values = dict(values)
    if differs_clearly(noise.stands_for_px, values["pixel"]):
        values["pixel"] = float(f"{noise.stands_for_px:.3g}")
    settings = {**side, **noise.setting(side), **written(values, PIXEL | IMU | WALKS)}
    near = (of_fit.best_s, clock.NEAR_STEPS) if of_fit.is_near else (float(side[OFFSET]),)
    offset = clock.surer(of_fit, clock.of_imu(bench, settings | slots.fewer(settings), *near))
    settings, words = _clock(settings, offset, {"camera-offset": side[OFFSET]})
    outcome = bench.run(settings)
    offset_s = float(settings.pop(OFFSET))
    said = [words]
    return Tuned(
        merged(settings) | offset_settings(offset_s), before, outcome, noise, said, offset_s
    )
