# SPDX-License-Identifier: MIT
"""Names, units and words of the settings in a CONFIG frame (docs/REPLAY-FORMAT.md)."""

from __future__ import annotations

from typing import NamedTuple

SWITCH = ("off", "on")


class Setting(NamedTuple):
    """A row of the format's table; `words` name the values of a choice."""

    name: str
    unit: str = ""
    words: tuple[str, ...] = ()
    of_axis: int = 0  # id of the setting that sets this one too, the sigma of a single axis


SETTINGS: dict[int, Setting] = {
    1: Setting("model", words=("body", "world")),
    2: Setting("mode", words=("slam", "mapping", "localization", "dead_reckoning")),
    3: Setting("bias", words=SWITCH),
    4: Setting("slots"),
    5: Setting("known-map", words=SWITCH),
    6: Setting("twist-timing", words=("start", "end", "mid")),
    7: Setting("noise", words=("twist", "step")),
    8: Setting("pixel-sigma", "px"),
    9: Setting("velocity-sigma", "m/s"),
    10: Setting("gyro-sigma", "rad/s"),
    11: Setting("bias-velocity-sigma", "m/s"),
    12: Setting("bias-gyro-sigma", "rad/s"),
    13: Setting("bias-velocity-walk", "(m/s)^2/s"),
    14: Setting("bias-gyro-walk", "(rad/s)^2/s"),
    15: Setting("gate-d2"),
    16: Setting("gate-residual", "px"),
    17: Setting("min-disparity", "px"),
    18: Setting("max-depth", "m"),
    19: Setting("max-row-gap", "px"),
    20: Setting("min-depth", "m"),
    21: Setting("start-sigma", "m and rad"),
    22: Setting("landmark-sigma", "m"),
    23: Setting("max-range", "m"),
    24: Setting("max-gap", "s"),
    25: Setting("twist-delay", "s"),
    26: Setting("landmark-prior", words=("correlated", "independent")),
    27: Setting("velocity-sigma-y", "m/s", of_axis=9),
    28: Setting("velocity-sigma-z", "m/s", of_axis=9),
    29: Setting("gyro-sigma-y", "rad/s", of_axis=10),
    30: Setting("gyro-sigma-z", "rad/s", of_axis=10),
}


def describe(id: int, value: float) -> tuple[str, str]:
    """Name and value with its unit; an id of a later version shows as its number."""
    setting = SETTINGS.get(id, Setting(f"setting {id}"))
    words = dict(enumerate(setting.words))
    if value in words:  # 1.0 finds the key 1
        return setting.name, words[int(value)]
    return setting.name, f"{value:g} {setting.unit}".strip()
