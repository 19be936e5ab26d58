# SPDX-License-Identifier: MIT
"""Twist timing, clock offset, biases and noises of a recording, by what makes its observations
likeliest.

A parameter more must pay: what was seen must become so much likelier that chance would not do it.
Where the tracks drift, the likelihood of a single step is blind to what matters (tracks_noise.py):
then pixel-sigma is the one that stands for the drift, and the twists' sigmas are as given, but no
larger than what the images allow. What comes out must be likelier than what was given in both
halves of the drive, else the latter stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pelorus.check import clock, tuning_imu
from pelorus.check.options import Settings
from pelorus.check.outcome import LENGTH, OFFSET, PART, Bench
from pelorus.check.parameters import (
    AXES,
    PAYS,
    TWIST,
    Tuned,
    fewer_slots,
    merged,
    offset_settings,
    pooled,
    starting,
    written,
)
from pelorus.check.search import COARSE, COARSE_FRAMES, Found, search_noises
from pelorus.check.tracks_noise import TrackNoise, track_noise
from pelorus.converters.twist_noise import Spread, difference_of_a_reading
from pelorus.layout import Floats

WIDE = {"bias": "on", "bias-velocity-sigma": "0.1", "bias-gyro-sigma": "0.03"}
PRIORS = {"bias-gyro-sigma": "rad/s", "bias-velocity-sigma": "m/s"}
FRAMES_FEW = 20  # tell a spread to a fifth: enough to begin with
SURE = 3.0  # sigmas that the common part of two halves' biases must be from zero
ALIKE = 0.7  # cosine of the angle between them
FINE = (1.3, 1.15)
OF_AXES = (2.0, 1.5)  # from one for all axes to each its own it may be far
CLOCK = ("camera-offset", "twist-timing", "imu-timing")


def tune(bench: Bench, given: Settings) -> Tuned:
    """`given` are the settings as they are: they hold wherever nothing better is found."""
    found = tuning_imu.tune(bench, given) if bench.by_imu else _tune(bench, given)
    return held_against(bench, given, found)


def held_against(bench: Bench, given: Settings, found: Tuned) -> Tuned:
    """What fits one half of the drive alone fits no drive to come."""
    if found.noise.drifts:  # no likelihood was asked
        return found
    # the clock was judged by a parabola: a single cost depends on how frames cut the readings, too
    clocked = {k: v for k, v in found.settings.items() if k in CLOCK}
    settings = {k: v for k, v in given.items() if k not in CLOCK} | clocked
    halves = [{**some, PART: part} for part in "01" for some in (settings, found.settings)]
    ran = bench.run_all(halves, "both halves")
    if all(new.gain_over(old) >= 0 for old, new in (ran[:2], ran[2:])):
        return found
    words = "no noises are likelier than yours in both halves of the drive: yours stay"
    outcome = bench.run(settings)
    return Tuned(
        settings, found.before, outcome, found.noise, [words, *found.of_clock], found.offset_s
    )


def _tune(bench: Bench, given: Settings) -> Tuned:
    before = bench.run(given)
    noise = track_noise(bench.examined)
    start = starting(bench.header, given, TWIST)
    names = tuple(parameter.setting for parameter in TWIST.values())
    fixed = {k: v for k, v in given.items() if not k.startswith(names)}
    fixed[OFFSET] = fixed.pop("camera-offset", "0")
    if noise.drifts:
        found = _of_drifting_tracks(bench, fixed, start, noise)
        fixed, words = _bias_of_halves(bench, fixed, found.values)
        offset_s = float(fixed.pop(OFFSET))
        settings = fixed | written(found.values, TWIST) | offset_settings(offset_s)
        return Tuned(settings, before, bench.run(settings), noise, [words])
    rough = fixed | WIDE | fewer_slots(given)
    values = _roughly(bench, rough | {LENGTH: COARSE_FRAMES}, start)
    offset = clock.of_twists(bench, rough | written(values, TWIST))
    if offset.gain > PAYS:  # what a wrong clock does is no noise
        rough[OFFSET] = f"{offset.best_s:.6f}"
        values = search_noises(bench, rough | {LENGTH: COARSE_FRAMES}, values, TWIST, COARSE).values
    moved = fixed | WIDE | {OFFSET: rough[OFFSET]}
    values = search_noises(bench, moved, values, TWIST, (1.5, 1.25)).values
    fixed, of_bias = _bias(bench, moved, values)
    fixed, found, of_clock = clocked(bench, fixed, values, given)
    found, of_axes = _axes(bench, fixed, found)
    offset_s = float(fixed.pop(OFFSET))
    settings = merged(fixed | written(found.values, TWIST)) | offset_settings(offset_s)
    said = [of_bias, of_clock, of_axes]
    return Tuned(settings, before, found.outcome, noise, said, offset_s, [of_clock])


def _roughly(bench: Bench, side: Settings, start: Mapping[str, float]) -> dict[str, float]:
    """From what is given, and from what the images say of the twists: the likelier of the two.

    With sigmas that are far too small a filter finds contradictions all along and widens what it
    believes, which can be the best for many steps around.
    """
    starts = [start]
    most = difference_of_a_reading(bench.examined, FRAMES_FEW)
    if most is not None:
        starts.append(dict(start) | _of_twists(start, most))
    found = [search_noises(bench, side, some, TWIST, COARSE) for some in starts]
    return min(found, key=lambda some: some.outcome.cost).values


def _of_twists(start: Mapping[str, float], spread: Spread) -> dict[str, float]:
    """The sigmas of the twists alone."""
    said = {"velocity": spread.velocity_mps, "gyro": spread.gyro_radps}
    of = {name: said.get(name.partition("-")[0], 0.0) for name in start}
    return {name: value for name, value in of.items() if value > 0}


# --- tracks that drift ----------------------------------------------------------------------------


def _of_drifting_tracks(
    bench: Bench, fixed: Settings, start: Mapping[str, float], noise: TrackNoise
) -> Found:
    values = dict(start)
    if np.isfinite(noise.stands_for_px):
        values["pixel"] = float(f"{noise.stands_for_px:.3g}")
    most = difference_of_a_reading(bench.examined)
    if most is not None:
        of_twists = _of_twists(start, most)
        values |= {name: min(start[name], value) for name, value in of_twists.items()}
    return Found(values, bench.run({**fixed, **written(values, TWIST)}))


# --- biases ---------------------------------------------------------------------------------------


def _bias(bench: Bench, fixed: Settings, values: Mapping[str, float]) -> tuple[dict[str, str], str]:
    """Of each kind that both halves of the drive tell alike, if the drive is likelier with it.

    As wide as what they tell: of priors the likeliest may be narrower than the bias of the one axis
    that has one, for the three axes share it.
    """
    side = {**fixed, **WIDE, **written(values, TWIST)}
    halves = _halves(bench, side)
    said = []
    for name, unit in PRIORS.items():
        tried = [{**side, name: "0"}, {**side, name: f"{halves[name]:.2g}"}]
        none, some = bench.run_all(tried, "biases")
        pays = halves[name] > 0 and some.gain_over(none) > PAYS
        side[name] = f"{halves[name]:.2g}" if pays else "0"
        if pays:
            said.append(f"of the {name.split('-')[1]} readings of about {side[name]} {unit}")
    kept = {k: side[k] for k in PRIORS}
    if not said:
        without = {k: v for k, v in fixed.items() if k not in WIDE}
        return {**without, "bias": "off"}, "no bias that both halves of the drive agree on"
    words = f"biases {' and '.join(said)}, in both halves alike"
    return {**fixed, "bias": "on", **kept}, words


def _halves(bench: Bench, settings: Settings) -> dict[str, float]:
    """The size of the bias that both halves of the drive tell alike, by the name of its prior.

    What else looks like a bias for a while does not stay the same. An axis that nothing measures
    has none.
    """
    ran = bench.run_all([{**settings, PART: part} for part in "01"], "biases of both halves")
    twists = bench.examined
    found = {}
    for name, axes, readings in (
        ("bias-gyro-sigma", slice(3, 6), twists.w_B_radps),
        ("bias-velocity-sigma", slice(0, 3), twists.v_B_mps),
    ):
        there = np.any(readings != 0, axis=0)
        told = [(half.bias[axes][there], half.bias_variance[axes][there]) for half in ran]
        found[name] = common_bias(*told[0], *told[1]) if there.any() else 0.0
    return found


def _bias_of_halves(
    bench: Bench, fixed: Settings, values: Mapping[str, float]
) -> tuple[dict[str, str], str]:
    """Both halves of the drive must tell the same gyro bias.

    Tracks that drift look like a bias of the velocity all along, so with them there is none of it
    to be told, and likelihood would find one.
    """
    size = _halves(bench, {**fixed, **WIDE, **written(values, TWIST)})["bias-gyro-sigma"]
    if not size > 0:
        return {**fixed, "bias": "off"}, "no bias that both halves of the drive agree on"
    prior = {"bias-velocity-sigma": "0", "bias-gyro-sigma": f"{size:.2g}"}
    words = f"biases of the gyro readings of about {size:.2g} rad/s, in both halves alike"
    return {**fixed, "bias": "on", **prior}, words


def common_bias(b0: Floats, var0: Floats, b1: Floats, var1: Floats) -> float:
    """The size of an axis' bias that two drives tell alike; 0 if chance may have made it.

    The errors of the two are independent: their products have no mean but the bias squared.
    """
    if not (min(var0.min(), var1.min()) > 0):
        return 0.0
    products = b0 * b1
    score = float(np.sum(products / np.sqrt(var0 * var1))) / np.sqrt(len(products))
    alike = float(np.sum(products)) / float(np.linalg.norm(b0) * np.linalg.norm(b1) + 1e-30)
    if score < SURE or alike < ALIKE:
        return 0.0
    return float(np.sqrt(np.mean(products)))


# --- clocks ---------------------------------------------------------------------------------------


def clocked(
    bench: Bench, fixed: Settings, values: Mapping[str, float], given: Settings
) -> tuple[dict[str, str], Found, str]:
    """Timing and the offset of the camera's clock; the noises again where they change.

    With several readings a frame the offset tells both: another timing is one of a whole reading.
    With a single one the timings are tried; `mid` competes only if it is given, for it is the mean
    of two readings, and would win for its smaller noise alone.
    """
    was_s = float(given.get("camera-offset", "0"))
    timing = fixed.get("twist-timing", bench.header.twist_timing.name.lower())
    side = {**fixed, **written(values, TWIST), "twist-timing": timing}
    offset = clock.of_twists(bench, side)
    settings = {**fixed, "twist-timing": timing, OFFSET: f"{was_s:.6f}"}
    words = f"twist-timing {timing}, and the clocks agree"
    if np.isfinite(offset.sigma_s):
        words += f" (known to {2e3 * offset.sigma_s:.2g} ms)"
        if ((offset.best_s - was_s) / offset.sigma_s) ** 2 > PAYS:
            settings, words = _moved(bench, settings, offset, timing)
    else:
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
    """By the offset, or by the timing that moves the readings as far."""
    period_s = clock.seconds(bench.examined.twist_t_ns)
    near_s = max(3 * offset.sigma_s, 0.25 * period_s)
    for name in ("start", "end"):
        as_far_s = (clock.MIDDLES[timing] - clock.MIDDLES[name]) * period_s
        if name != timing and abs(offset.best_s - as_far_s) < near_s:
            words = f"twist-timing is {name}, not {timing} (likelihood {offset.gain:+.0f}), or the "
            words += f"camera's clock is {abs(as_far_s) * 1e3:.0f} ms off: one is like the other"
            return {**settings, "twist-timing": name, OFFSET: "0"}, words
    late = "late" if offset.best_s < 0 else "early"
    words = (
        f"the camera's clock is {abs(offset.best_s) * 1e3:.0f} ms {late} beside that of the "
        f"twists, known to {2e3 * offset.sigma_s:.2g} ms (likelihood {offset.gain:+.0f})"
    )
    return {**settings, OFFSET: f"{offset.best_s:.6f}"}, words


# --- axes -----------------------------------------------------------------------------------------


def _axes(bench: Bench, fixed: Settings, found: Found) -> tuple[Found, str]:
    """A sigma for each axis where that pays: two parameters more for each of the two."""
    split = {"pixel": found.values["pixel"]}
    for name in ("velocity", "gyro"):
        for axis in AXES:
            key = f"{name}-{axis}"
            split[key] = found.values[key] if key in found.values else found.values[name]
    rough = search_noises(
        bench, {**fixed, **fewer_slots(fixed)}, split, TWIST, OF_AXES, "noise by axis"
    )
    result = search_noises(bench, fixed, rough.values, TWIST, FINE[1:], "noise by axis")
    said = []
    for name in ("velocity", "gyro"):
        alike = {k: v for k, v in result.values.items() if not k.startswith(name)}
        alike |= {name: pooled(result.values, name)}
        one = Found(alike, bench.run({**fixed, **written(alike, TWIST)}))
        if name in found.values:  # the best for all axes that is known
            best = {**alike, name: found.values[name]}
            other = Found(best, bench.run({**fixed, **written(best, TWIST)}))
            one = min(one, other, key=lambda some: some.outcome.cost)
        gain = result.outcome.gain_over(one.outcome)
        if gain > 2 * PAYS:
            said.append(f"{TWIST[name].setting} by axis (likelihood {gain:+.0f})")
        else:
            result = one
    better = result if result.outcome.cost < found.outcome.cost else found
    return better, ", ".join(said) or "one sigma for all axes"
