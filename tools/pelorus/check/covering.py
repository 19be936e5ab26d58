# SPDX-License-Identifier: MIT
"""Settings that make up for what a recording shows to be off, or that estimate it."""

from __future__ import annotations

from collections.abc import Sequence

from pelorus.faults.amounts import CLOCK_OFF_S
from pelorus.faults.fault import Fault
from pelorus.wire.frames import Message
from pelorus.wire.framing import header_of_messages
from pelorus.wire.schema import DEFAULTS, SETTINGS
from pelorus.wire.settings import IDS, in_force

CALIBRATE, OFFSET, PIXEL = "calibrate", "camera-offset", "pixel-sigma"
SIGMAS = 2.0  # within which what is off must be of its setting's sigma


def covering(messages: Sequence[Message], faults: Sequence[Fault]) -> dict[str, str]:
    """Returns the settings for what those of a run leave as it is."""
    asked: dict[str, str] = {}
    parts = _calibrated(messages)
    for fault in not_covered(messages, faults):
        asked |= fault.settings
        if CALIBRATE in fault.settings:
            parts.append(fault.settings[CALIBRATE])
            asked[CALIBRATE] = ",".join(dict.fromkeys(parts))
    return asked


def not_covered(messages: Sequence[Message], faults: Sequence[Fault]) -> list[Fault]:
    """Returns the faults without those that the settings of a run make up for."""
    parts = _calibrated(messages)
    return [fault for fault in faults if not _is_covered(messages, parts, fault)]


def noises_are_usual(messages: Sequence[Message]) -> bool:
    """Returns whether a run's pixels have the recording's own noise, or the default one."""
    told = header_of_messages(messages).noise.pixel_sigma_px
    usual = told if told > 0 else DEFAULTS[PIXEL]
    return abs((in_force(messages, PIXEL) or usual) - usual) < 1e-4 * usual


def _is_covered(messages: Sequence[Message], parts: Sequence[str], fault: Fault) -> bool:
    return bool(fault.settings) and all(
        value in parts if name == CALIBRATE else _is_set(name, in_force(messages, name), value)
        for name, value in fault.settings.items()
    )


def _is_set(name: str, value: float | None, asked: str) -> bool:
    if name == OFFSET:
        return abs((value or 0.0) - float(asked)) < CLOCK_OFF_S
    return (value or 0.0) >= float(asked) / SIGMAS


def _calibrated(messages: Sequence[Message]) -> list[str]:
    """Returns the parts of the calibration that a run estimates."""
    bits = int(in_force(messages, CALIBRATE) or 0)
    words = SETTINGS[IDS[CALIBRATE]].words
    return [word for k, word in enumerate(words) if bits >> k & 1]
