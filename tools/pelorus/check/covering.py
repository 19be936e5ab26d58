# SPDX-License-Identifier: MIT
"""Settings by which the filter estimates what a recording shows to be off."""

from __future__ import annotations

from collections.abc import Sequence

from pelorus.faults.fault import Fault
from pelorus.wire.frames import Message
from pelorus.wire.schema import SETTINGS
from pelorus.wire.settings import IDS, in_force

CALIBRATE = "calibrate"
SIGMAS = 2.0  # within which what is off must be of its setting's sigma


def covering(messages: Sequence[Message], faults: Sequence[Fault]) -> dict[str, str]:
    """Returns the settings by which a run would estimate what its own settings leave as it is."""
    asked: dict[str, str] = {}
    parts = _calibrated(messages)
    for fault in not_covered(messages, faults):
        if fault.settings:
            parts.append(fault.settings[CALIBRATE])
            asked |= {**fault.settings, CALIBRATE: ",".join(dict.fromkeys(parts))}
    return asked


def not_covered(messages: Sequence[Message], faults: Sequence[Fault]) -> list[Fault]:
    """Returns the faults without those that the settings of a run estimate."""
    parts = _calibrated(messages)
    return [fault for fault in faults if not _is_covered(messages, parts, fault)]


def _is_covered(messages: Sequence[Message], parts: Sequence[str], fault: Fault) -> bool:
    sigmas = {name: float(x) for name, x in fault.settings.items() if name != CALIBRATE}
    wide = all((in_force(messages, name) or 0.0) >= x / SIGMAS for name, x in sigmas.items())
    return bool(fault.settings) and wide and fault.settings[CALIBRATE] in parts


def _calibrated(messages: Sequence[Message]) -> list[str]:
    """Returns the parts of the calibration that a run estimates."""
    bits = int(in_force(messages, CALIBRATE) or 0)
    words = SETTINGS[IDS[CALIBRATE]].words
    return [word for k, word in enumerate(words) if bits >> k & 1]
