# SPDX-License-Identifier: MIT
"""Twist timing, clock offset, biases and noises of a recording, by what makes its observations
likeliest.

A parameter more must pay: what was seen must become so much likelier that chance would not do it.
Where the tracks drift, the likelihood of a single step is blind to what matters (tracks_noise.py):
then pixel-sigma is the one that stands for the drift, and the twists' sigmas are as given, but no
larger than what the images allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pelorus.check.outcome import LENGTH, OFFSET, PART, Bench, Outcome, Settings
from pelorus.check.search import Found, foot, search
from pelorus.check.tracks_noise import TrackNoise, track_noise
from pelorus.converters.twist_noise import difference_of_a_reading
from pelorus.frames import Header
from pelorus.layout import Floats
from pelorus.motion import Times

AXES = "xyz"
LIMITS = {"pixel": (0.02, 100.0), "velocity": (1e-4, 30.0), "gyro": (1e-5, 3.0)}
NAMES = {"pixel": "pixel-sigma", "velocity": "velocity-sigma", "gyro": "gyro-sigma"}
DEFAULTS = {"pixel": 2.0, "velocity": 0.1, "gyro": 0.01}
PAYS = 20.0  # -2 ln of the likelihood ratio that one parameter more, or another timing, must bring
WIDE = {"bias": "on", "bias-velocity-sigma": "0.1", "bias-gyro-sigma": "0.03"}
SURE = 3.0  # sigmas that the common part of two halves' biases must be from zero
ALIKE = 0.7  # cosine of the angle between them
OFFSET_MOST_S = 0.1
OFFSET_STEP_S = 0.01  # at least, in whole readings
COARSE, COARSE_FRAMES = (2.0, 2.0, 2.0, 2.0), "300"
FINE = (1.3, 1.15)


@dataclass(frozen=True)
class Tuned:
    """Settings to write, and why; `offset_s` is added to the frames' times."""

    settings: dict[str, str]
    before: Outcome
    after: Outcome
    noise: TrackNoise
    said: list[str] = field(default_factory=list)
    offset_s: float = 0.0


def tune(bench: Bench, given: Settings) -> Tuned:
    """`given` are the settings as they are: they hold wherever nothing better is found."""
    before = bench.run(given)
    noise = track_noise(bench.examined)
    start = starting_sigmas(bench.header, given)
    fixed = {k: v for k, v in given.items() if k not in NAMES.values()}
    said = []
    if noise.drifts:
        found = _of_drifting_tracks(bench, fixed, start, noise)
        fixed, words = _bias(bench, fixed, found.values, drifts=True)
        said.append(words)
        settings = fixed | _written(found.values)
        return Tuned(_merged(settings), before, bench.run(settings), noise, said)

    def noise_of(side: Settings, values: Mapping[str, float], steps: Sequence[float]) -> Found:
        build = lambda v: {**side, **_written(v)}  # noqa: E731 - named where it is used
        return search(bench, values, _limits(values), build, steps)

    coarse = noise_of(fixed | WIDE | {LENGTH: COARSE_FRAMES}, start, COARSE).values
    without, with_ = (
        noise_of(side, coarse, (1.5, 1.25)) for side in ({**fixed, "bias": "off"}, fixed | WIDE)
    )
    found = min((without, with_), key=lambda f: f.outcome.cost)
    fixed, words = _bias(bench, fixed, found.values, drifts=False)
    said.append(words)
    fixed, found, words = clock(bench, fixed, found.values)
    said.append(words)
    found, words = _axes(bench, fixed, found)
    said.append(words)
    offset_s = float(fixed.pop(OFFSET, "0"))
    settings = _merged(fixed | _written(found.values))
    return Tuned(
        settings | _offset_settings(offset_s), before, found.outcome, noise, said, offset_s
    )


def starting_sigmas(header: Header, given: Settings) -> dict[str, float]:
    """What is set, else what the recording suggests, else the defaults."""
    noise = header.noise
    suggested = {
        "pixel": noise.pixel_sigma_px,
        "velocity": noise.velocity_sigma_mps,
        "gyro": noise.gyro_sigma_radps,
    }
    out = {}
    for name, setting in NAMES.items():
        value = suggested[name] if suggested[name] > 0 else DEFAULTS[name]
        if setting in given:
            value = float(np.mean([float(part) for part in given[setting].split(",")]))
        out[name] = min(max(value, LIMITS[name][0]), LIMITS[name][1])
    return out


def _limits(values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    return {name: LIMITS[name.partition("-")[0]] for name in values}


def _written(values: Mapping[str, float]) -> dict[str, str]:
    """As settings: of velocity, or of velocity-x, -y, -z."""
    out = {}
    for name, setting in NAMES.items():
        if name in values:
            out[setting] = f"{values[name]:.4g}"
        else:
            out[setting] = ",".join(f"{values[f'{name}-{axis}']:.4g}" for axis in AXES)
    return out


def _merged(settings: Settings) -> dict[str, str]:
    return {k: v for k, v in settings.items() if not k.startswith("@")}


def _offset_settings(offset_s: float) -> dict[str, str]:
    """A frame that is moved to an earlier time must find the twists held back."""
    if offset_s == 0:
        return {}
    out = {"camera-offset": f"{offset_s:.4g}"}
    return out if offset_s > 0 else out | {"twist-delay": f"{-offset_s:.4g}"}


def _again(bench: Bench, fixed: Settings, values: Mapping[str, float], what: str) -> Found:
    return search(bench, values, _limits(values), lambda v: {**fixed, **_written(v)}, FINE, what)


# --- tracks that drift ----------------------------------------------------------------------------


def _of_drifting_tracks(
    bench: Bench, fixed: Settings, start: Mapping[str, float], noise: TrackNoise
) -> Found:
    values = dict(start)
    if np.isfinite(noise.stands_for_px):
        values["pixel"] = float(f"{noise.stands_for_px:.3g}")
    most = difference_of_a_reading(bench.examined)
    if most is not None:
        values["velocity"] = min(values["velocity"], most.velocity_mps)
        values["gyro"] = min(values["gyro"], most.gyro_radps)
    return Found(values, bench.run({**fixed, **_written(values)}))


# --- biases ---------------------------------------------------------------------------------------


def _bias(
    bench: Bench, fixed: Settings, values: Mapping[str, float], drifts: bool
) -> tuple[dict[str, str], str]:
    """Both halves of the drive must tell the same bias.

    What else looks like a bias for a while does not stay the same. Tracks that drift look like a
    bias of the velocity all along, so with them there is none to be told.
    """
    wide = {**fixed, **WIDE, **_written(values)}
    halves = bench.run_all([wide | {PART: part} for part in "01"], "biases of both halves")
    prior, found = {}, []
    for name, unit, axes in (("velocity", "m/s", slice(0, 3)), ("gyro", "rad/s", slice(3, 6))):
        told = [(half.bias[axes], half.bias_variance[axes]) for half in halves]
        size = 0.0 if drifts and name == "velocity" else common_bias(*told[0], *told[1])
        prior[f"bias-{name}-sigma"] = f"{size:.2g}"
        if size > 0:
            found.append(f"of the {name} readings of about {size:.2g} {unit}")
    if not found:
        return {**fixed, "bias": "off"}, "no bias that both halves of the drive agree on"
    return {**fixed, "bias": "on", **prior}, f"biases {' and '.join(found)}, in both halves alike"


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


def clock(
    bench: Bench, fixed: Settings, values: Mapping[str, float]
) -> tuple[dict[str, str], Found, str]:
    """Timing start or end, and the offset of the camera's clock.

    `mid` competes only if it is given: it is the mean of two readings, and would win for its
    smaller noise alone. So would an offset by parts of a reading: those tried are whole readings,
    and a parabola through the best three gives the rest.
    """
    given = fixed.get("twist-timing", bench.header.twist_timing.name.lower())
    timings = tuple(dict.fromkeys((given, "start", "end")))
    tried = {timing: {**fixed, "twist-timing": timing, **_written(values)} for timing in timings}
    by_timing = dict(zip(timings, bench.run_all(list(tried.values()), "timing"), strict=True))
    timing = min(by_timing, key=lambda name: by_timing[name].cost)
    offset_s, outcome = offset_of(bench, tried[given], by_timing[given])
    gains = by_timing[timing].gain_over(by_timing[given]), outcome.gain_over(by_timing[given])
    # one reading later or earlier is the other timing; an offset must say more than that
    if gains[1] > max(gains[0], 0.0) + PAYS:
        timing = given
    elif gains[0] > PAYS:
        offset_s = 0.0
    else:
        timing, offset_s = given, 0.0
    settings = {**fixed, "twist-timing": timing}
    if offset_s:
        settings[OFFSET] = f"{offset_s:.4g}"
    return (
        settings,
        _again(bench, settings, values, "noise"),
        _clock_words(given, timing, offset_s, gains[1] if offset_s else gains[0]),
    )


def offset_of(bench: Bench, settings: Settings, usual: Outcome) -> tuple[float, Outcome]:
    """The likeliest offset, s; 0 where there is a single reading a frame."""
    period_s = _seconds(bench.examined.twist_t_ns)
    if _seconds(bench.examined.frame_t_ns) < 2 * period_s or not period_s > 0:
        return 0.0, usual
    step_s = period_s * max(round(OFFSET_STEP_S / period_s), 1)
    most = int(OFFSET_MOST_S / step_s)
    steps = [k for k in range(-most, most + 1) if k]
    if not steps:
        return 0.0, usual
    shifted = [{**settings, OFFSET: f"{k * step_s:.6g}"} for k in steps]
    costs = dict(zip(steps, bench.run_all(shifted, "clock"), strict=True)) | {0: usual}
    best = min(costs, key=lambda k: costs[k].cost)
    beside = [costs[k].cost if k in costs else np.inf for k in (best - 1, best, best + 1)]
    return (best + foot(*beside)) * step_s, costs[best]


def _seconds(t_ns: Times) -> float:
    return float(np.median(np.diff(t_ns))) * 1e-9 if len(t_ns) > 2 else 0.0


def _clock_words(given: str, timing: str, offset_s: float, gain: float) -> str:
    if offset_s:
        late = "late" if offset_s < 0 else "early"
        return (
            f"the camera's clock is {abs(offset_s) * 1e3:.0f} ms {late} beside that of the twists"
            f" (likelihood {gain:+.0f})"
        )
    if timing != given:
        return f"twist-timing is {timing}, not {given} (likelihood {gain:+.0f})"
    return f"twist-timing {timing}, and the clocks agree"


# --- axes -----------------------------------------------------------------------------------------


def _axes(bench: Bench, fixed: Settings, found: Found) -> tuple[Found, str]:
    """A sigma for each axis where that pays: two parameters more for each of the two."""
    split = {"pixel": found.values["pixel"]} | {
        f"{name}-{axis}": found.values[name] for name in ("velocity", "gyro") for axis in AXES
    }
    result = _again(bench, fixed, split, "noise by axis")
    said = []
    for name in ("velocity", "gyro"):
        of_axes = [result.values[f"{name}-{axis}"] for axis in AXES]
        pooled = {k: v for k, v in result.values.items() if not k.startswith(name)}
        pooled[name] = float(np.exp(np.mean(np.log(of_axes))))
        one = Found(pooled, bench.run({**fixed, **_written(pooled)}))
        gain = result.outcome.gain_over(one.outcome)
        if gain > 2 * PAYS:
            said.append(f"{NAMES[name]} by axis (likelihood {gain:+.0f})")
        else:
            result = one
    better = result if result.outcome.cost < found.outcome.cost else found
    return better, ", ".join(said) or "one sigma for all axes"
