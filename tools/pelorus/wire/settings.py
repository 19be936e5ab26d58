# SPDX-License-Identifier: MIT
"""The settings in a CONFIG frame, by name and in words."""

from __future__ import annotations

from collections.abc import Sequence

from pelorus.wire.frames import Config, Message
from pelorus.wire.schema import SETTINGS, Setting, word_of

__all__ = [
    "CALIBRATION_SIGMAS",
    "IDS",
    "SETTINGS",
    "Setting",
    "describe",
    "in_force",
    "mode_in_force",
]

IDS = {setting.name: id for id, setting in SETTINGS.items()}

# Errors of the camera that the covariances cover; 0: it is exact.
CALIBRATION_SIGMAS = (
    "focal-sigma",
    "baseline-sigma",
    "camera-turn-sigma",
    "centre-sigma",
    "camera-place-sigma",
    "camera-clock-sigma",
)


def describe(id: int, value: float) -> tuple[str, str]:
    """Returns name and value with its unit; an unknown id of a later version as a number."""
    setting = SETTINGS.get(id, Setting(f"setting {id}"))
    if setting.is_list:
        listed = [word for bit, word in enumerate(setting.words) if int(value) >> bit & 1]
        return setting.name, ",".join(listed) or "off"
    words = dict(enumerate(setting.words))
    if value in words:  # 1.0 finds the key 1
        return setting.name, words[int(value)]
    return setting.name, f"{value:g} {setting.unit}".strip()


def in_force(messages: Sequence[Message], name: str) -> float | None:
    """Returns the value of a setting of the filter of this result; None if it is not in it."""
    configs = [m for m in messages if isinstance(m, Config) and m.build_fingerprint]
    return configs[-1].settings.get(IDS[name]) if configs else None


def mode_in_force(messages: Sequence[Message]) -> str:
    """Returns slam, mapping, localization or dead_reckoning; empty if the result has none."""
    mode = in_force(messages, "mode")
    return "" if mode is None else word_of("mode", mode)
