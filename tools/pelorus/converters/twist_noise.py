# SPDX-License-Identifier: MIT
"""Measures the twists' noise against the camera's own motion, where that is the more precise one.

From one frame to the next the common tracks give the camera's motion, and with the extrinsic the
body's. The twists' differs from it by their own noise and by that of the images. The latter is
measured, too: each half of the tracks gives a motion; the two are independent, and their difference
is twice as large as the error of the motion from all tracks. Where the twists differ by clearly
more, that is their noise, and the HEADER suggests it as the sigma of a reading. Spreads are taken
about the median: a bias is no noise. They are those of most frames: a robot that stands for half of
the recording and is noisier when it moves should be given its sigmas.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.tracking import visual_motion
from pelorus.tracking.visual_motion import PAIRS_MIN, SeenPairs, seen_pairs
from pelorus.wire.frames import TwistTiming
from pelorus.wire.layout import Floats

PAIRS_ENOUGH = 2 * PAIRS_MIN  # so that each half has enough
FRAMES_ENOUGH = 100  # a spread from so many is good to 10 %
CLEARLY = 3.0  # ratio to the images' own noise, which then adds at most 6 %
MAD_TO_SIGMA = 1.4826  # of a normal distribution


@dataclass(frozen=True)
class TwistSpread:
    """The sigma of one axis, of velocities and of rates."""

    velocity_mps: float
    gyro_radps: float


def suggest(recording: Recording) -> tuple[Recording, Finding]:
    """Writes the twists' noise into the HEADER, as far as the images show it.

    Sigmas that it holds already stay.
    """
    subject = "twist noise"
    camera = recording.header.camera
    seen = seen_pairs(recording.tracks, camera, 1)
    usable = seen.counts() >= PAIRS_ENOUGH
    if usable.sum() < FRAMES_ENOUGH:
        evidence = f"{int(usable.sum())} frames with tracks enough, {FRAMES_ENOUGH} are expected"
        action = "no suggestion: give the sigmas"
        return recording, Finding(subject, False, evidence, action, is_conclusive=False)
    tau_s = np.diff(recording.frame_t_ns)[usable] * 1e-9
    halves = [visual_motion.estimate(half, camera) for half in _halves(seen)]
    images = _spread(_body(recording, halves[0]), _body(recording, halves[1]), usable, tau_s, 0.5)
    whole = _body(recording, visual_motion.estimate(seen, camera))
    of_reading = _of_reading(recording)
    twists = _spread(whole, recording.body_motion(1), usable, tau_s, of_reading)
    images = TwistSpread(of_reading * images.velocity_mps, of_reading * images.gyro_radps)
    return _decide(recording, twists, images, Finding(subject, False, _words(twists, images), ""))


def difference_of_a_reading(
    recording: Recording, fewest: int = FRAMES_ENOUGH
) -> TwistSpread | None:
    """Returns the difference of twists and images as the sigma of a reading.

    It is an upper bound of the twists' noise; None where fewer frames have enough tracks.
    """
    seen = seen_pairs(recording.tracks, recording.header.camera, 1)
    usable = seen.counts() >= PAIRS_ENOUGH
    if usable.sum() < fewest:
        return None
    tau_s = np.diff(recording.frame_t_ns)[usable] * 1e-9
    whole = _body(recording, visual_motion.estimate(seen, recording.header.camera))
    return _spread(whole, recording.body_motion(1), usable, tau_s, _of_reading(recording))


def _rounded(sigma: float) -> float:
    """Rounds to four digits, which is more than the data show."""
    return float(f"{sigma:.4g}")


def _decide(
    recording: Recording, twists: TwistSpread, images: TwistSpread, finding: Finding
) -> tuple[Recording, Finding]:
    noise, said = recording.header.noise, []
    if noise.velocity_sigma_mps < 0 and twists.velocity_mps > CLEARLY * images.velocity_mps:
        noise = replace(noise, velocity_sigma_mps=_rounded(twists.velocity_mps))
        said.append(f"velocity-sigma {twists.velocity_mps:.2g} m/s")
    if noise.gyro_sigma_radps < 0 and twists.gyro_radps > CLEARLY * images.gyro_radps:
        noise = replace(noise, gyro_sigma_radps=_rounded(twists.gyro_radps))
        said.append(f"gyro-sigma {twists.gyro_radps:.2g} rad/s")
    if not said:
        action = "no suggestion beyond what is given: else the filter's defaults hold"
        return recording, replace(finding, action=action)
    action = f"the HEADER suggests {' and '.join(said)}; options and a config override it"
    return recording.with_header(noise=noise), replace(finding, measured=True, action=action)


def _of_reading(recording: Recording) -> float:
    """Returns the factor from the sigma of a frame's mean velocity to that of one of its k
    readings.

    With `mid` each step is the mean of two neighbours, so the k + 1 readings count as k - 1/2.
    """
    frame, twist = np.diff(recording.frame_t_ns), np.diff(recording.twist_t_ns)
    k = max(float(np.median(frame) / np.median(twist)), 1.0)
    independent = k - 0.5 if recording.header.twist_timing is TwistTiming.MID else k
    return float(k / np.sqrt(independent))


def _words(twists: TwistSpread, images: TwistSpread) -> str:
    return (
        f"twists and images differ by {twists.velocity_mps:.2g} m/s and {twists.gyro_radps:.2g} "
        f"rad/s per axis and reading, of which the images' own error is {images.velocity_mps:.2g} "
        f"m/s and {images.gyro_radps:.2g} rad/s"
    )


def _halves(seen: SeenPairs) -> list[SeenPairs]:
    """Returns two halves of the tracks: every other pair."""
    even = np.arange(len(seen.frame)) % 2 == 0
    return [
        SeenPairs(
            seen.frame_count,
            seen.frame[half],
            seen.first_pixels[half],
            seen.q_C[half],
            seen.pixels[half],
        )
        for half in (even, ~even)
    ]


def _body(recording: Recording, motion_C: Poses) -> Poses:
    """Returns the body's motion for that of the camera: T_CB^-1 M T_CB."""
    return se3.compose(se3.compose(se3.inverse(recording.T_CB), motion_C), recording.T_CB)


def _spread(
    a: Poses, b: Poses, usable: NDArray[np.bool_], tau_s: Floats, factor: float
) -> TwistSpread:
    """Returns the spread of a^-1 b as a twist, times factor; the three axes are pooled."""
    difference = se3.compose(se3.inverse(a.at(usable)), b.at(usable))
    rate = se3.log(difference) / tau_s[:, None]
    axis = factor * MAD_TO_SIGMA * np.median(np.abs(rate - np.median(rate, axis=0)), axis=0)
    rms = np.sqrt(np.mean(axis.reshape(2, 3) ** 2, axis=1))
    return TwistSpread(float(rms[0]), float(rms[1]))
