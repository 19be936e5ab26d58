# SPDX-License-Identifier: MIT
"""Keeps the settings that were found only if they hold against those that were given.

The likeliest noises are those of single steps. They are right if the errors are what the settings
describe, new in every reading and every pixel. What fits one half of the drive alone fits no other
drive. An error that lasts longer than a step (a gyro that lags, a scale by a percent, a lever by
centimetres) is hidden by large noises; with small ones vision and twists contradict each other in
frame after frame. Then no likelihood of steps can decide, and a filter with the small noises would
be too sure.
"""

from __future__ import annotations

from dataclasses import replace

from pelorus.check.options import Settings
from pelorus.check.outcome import PART, Bench
from pelorus.check.parameters import Tuned, no_narrower, of_process

CLOCK = ("camera-offset", "twist-timing", "imu-timing")
BY_CHANCE = 0.05  # share of contradicted frames by chance: at most 0.02 was seen with white noise


def held_against(bench: Bench, given: Settings, found: Tuned) -> Tuned:
    """Returns the settings that were found, or the given ones with the clock that was found."""
    if found.noise.drifts:
        return _no_narrower(bench, given, found, found.settings) if _denied(found) else found
    yours = _with_clock_of(given, found)
    if not _likelier_in_both_halves(bench, yours, found.settings):
        words = "no noises are likelier than yours in both halves of the drive: yours stay"
        said = [words, *found.of_clock]
        return replace(found, settings=yours, after=bench.run(yours), said=said)
    return _no_narrower(bench, given, found, yours) if found.lasting or _denied(found) else found


def _denied(found: Tuned) -> bool:
    """Returns whether vision contradicts more frames with the found settings than before."""
    return found.after.contradicted > max(found.before.contradicted, BY_CHANCE)


def _likelier_in_both_halves(bench: Bench, yours: Settings, found: Settings) -> bool:
    halves = [{**some, PART: part} for part in "01" for some in (yours, found)]
    ran = bench.run_all(halves, "both halves")
    return all(new.gain_over(old) >= 0 for old, new in (ran[:2], ran[2:]))


def _with_clock_of(given: Settings, found: Tuned) -> dict[str, str]:
    """Returns the given settings with the found clock, which many offsets support."""
    clocked = {k: v for k, v in found.settings.items() if k in CLOCK}
    return {k: v for k, v in given.items() if k not in CLOCK} | clocked


def _no_narrower(bench: Bench, given: Settings, found: Tuned, side: Settings) -> Tuned:
    """Returns noises no smaller than the given ones, beside `side`: they cover lasting errors."""
    noises = no_narrower(bench.header, given, found.settings, of_process(bench.by_imu))
    settings = {**side, **noises}
    why = list(found.lasting)
    if _denied(found):
        why.append(
            "with the likeliest noises vision contradicts the twists (or the IMU) in "
            f"{found.after.contradicted:.0%} of the frames, with yours in "
            f"{found.before.contradicted:.0%}"
        )
    words = f"{'; '.join(why)}. That is off for longer than a step, and no noise: none is written "
    words += "that is smaller than yours"
    said = found.said if found.noise.drifts else found.of_clock
    after = bench.run(settings)
    return replace(found, settings=settings, after=after, said=said, doubts=[*found.doubts, words])
