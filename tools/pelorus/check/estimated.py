# SPDX-License-Identifier: MIT
"""Compares the calibration that the filter estimated in a run with the search's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pelorus.check.calibration import TURN_SURE, CalibrationDoubts, Turned
from pelorus.check.options import Settings
from pelorus.wire.calibrated import PARTS, Calibrated, CalibrationPart, last_calibrated
from pelorus.wire.frames import Message
from pelorus.wire.layout import Floats
from pelorus.wire.schema import SETTINGS
from pelorus.wire.settings import IDS, in_force

TOLD = 3.0  # sigmas from which a correction is reported
OFF_PRIOR = 4.0  # sigmas of the prior, as the filter's own reason CALIBRATION_OFF
TURN = slice(2, 5)  # of calibrated.PARTS
PRIORS = {
    "baseline": "baseline-sigma",
    "focal": "focal-sigma",
    "turn": "camera-turn-sigma",
    "centre": "centre-sigma",
    "place": "camera-place-sigma",
    "clock": "camera-clock-sigma",
    "wheel-scale": "wheel-scale-sigma",
    "wheel-track": "wheel-track-sigma",
}


@dataclass(frozen=True)
class Estimated:
    """The calibration that the filter estimated.

    `off`: settings whose sigma the estimate exceeds by far. `refused`: parts that were to be
    estimated and that the filter put back (CALIBRATION_OFF). `apart`: distance of the filter's turn
    of the camera from the search's, sigmas.
    """

    estimate: Calibrated
    off: tuple[str, ...]
    refused: tuple[str, ...]
    apart: float | None  # None: the search found no turn, or the turn is not estimated

    @property
    def answers_turn(self) -> bool:
        """Returns whether the filter's estimate explains the turn that the search found."""
        return bool(self.estimate.estimated >> TURN.start & 1) and (self.apart or 0.0) <= TURN_SURE

    def words(self) -> str:
        """Returns the estimate as one sentence."""
        parts = list(self.estimate.parts())
        clear = [_with_sigma(*part) for part in parts if abs(part[1]) > TOLD * part[2]]
        said = "the filter estimates the calibration on the way"
        if self.refused:
            said += (
                f", and refused {', '.join(self.refused)}: the drive would move it farther than "
                "what is learnt of it allows. The IMU's scale, axes or clock look so, or a "
                "calibration that is off by many sigmas: calibrate, or leave it out of calibrate"
            )
        elif not clear:
            known = ", ".join(f"{part.name} to {sigma:.2g} {part.unit}" for part, _, sigma in parts)
            return f"{said} and finds it right: {known}"
        if clear:
            said += f"; corrected by {', '.join(clear)}"
        if self.off:
            said += (
                f": more than {OFF_PRIOR:.0f} sigma by {', '.join(self.off)}. If the drive is "
                "right, take it over (pelorus info shows it); if not, an axis, a scale or a clock "
                "is wrong"
            )
        if self.apart is not None and self.apart > TURN_SURE:
            said += f"; the search sees the camera turned otherwise, by {self.apart:.1f} sigma"
        return said

    @property
    def is_doubtful(self) -> bool:
        return bool(self.off or self.refused) or (self.apart or 0.0) > TURN_SURE


def _with_sigma(part: CalibrationPart, value: float, sigma: float) -> str:
    return f"{part.name} {value:+.3g} +- {sigma:.2g} {part.unit}"


def estimated(messages: Sequence[Message], found: CalibrationDoubts) -> Estimated | None:
    """Returns what a run estimated; None where nothing is estimated."""
    estimate = last_calibrated(messages)
    if estimate is None:
        return None
    return Estimated(
        estimate,
        _off(messages, estimate),
        _refused(messages, estimate),
        _turns_apart(estimate, found.turn),
    )


def _off(messages: Sequence[Message], estimate: Calibrated) -> tuple[str, ...]:
    return tuple(dict.fromkeys(_settings_off(messages, estimate)))


def _settings_off(messages: Sequence[Message], estimate: Calibrated) -> Iterator[str]:
    for part, value, _ in estimate.parts():
        setting = PRIORS[_word(part)]
        si = value / (1.0 if part.unit == "px" else part.scale)
        if abs(si) > OFF_PRIOR * (in_force(messages, setting) or np.inf):
            yield setting


def _word(part: CalibrationPart) -> str:
    """Returns the setting calibrate's word for a part, which may be one of an axis."""
    words = SETTINGS[IDS["calibrate"]].words
    return next(word for word in words if part.key.replace("_", "-").startswith(word))


def _refused(messages: Sequence[Message], estimate: Calibrated) -> tuple[str, ...]:
    """Returns the parts that the setting calibrate names but that are not estimated at the end."""
    asked = int(in_force(messages, "calibrate") or 0)
    words = SETTINGS[IDS["calibrate"]].words
    parts = [(_word(part), estimate.estimated >> k & 1) for k, part in enumerate(PARTS)]
    return tuple(
        word
        for bit, word in enumerate(words)
        if asked >> bit & 1 and not all(on for of, on in parts if of == word)
    )


def _turns_apart(estimate: Calibrated, turn: Turned | None) -> float | None:
    """Returns the distance between the filter's and the search's turn of the camera, sigmas."""
    if turn is None or not estimate.estimated >> TURN.start & 1:
        return None
    by_filter, P = turn_in_body(estimate)
    off = turn.turn_rad - by_filter
    return float(np.sqrt(off @ np.linalg.solve(turn.covariance + P, off)))


def turn_in_body(estimate: Calibrated) -> tuple[Floats, Floats]:
    """Returns the camera's turn about the body's axes, rad, and its covariance, as Turned has them.

    T_CB <- Exp(phi) T_CB is T_CB Exp(R_BC phi).
    """
    R_BC = np.asarray(estimate.R_CB).T
    return R_BC @ estimate.corrected[TURN], R_BC @ np.diag(estimate.sigma[TURN] ** 2) @ R_BC.T


def without_clock(given: Settings) -> Settings:
    """Returns the settings for the clock's search, in which the filter estimates no clock."""
    listed = [part for part in given.get("calibrate", "").split(",") if part.strip() != "clock"]
    return {**given, "calibrate": ",".join(listed) or "off"} if "calibrate" in given else given
