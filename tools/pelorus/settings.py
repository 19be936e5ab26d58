# SPDX-License-Identifier: MIT
"""The settings in a CONFIG frame, in words."""

from __future__ import annotations

from pelorus.schema import SETTINGS, Setting

__all__ = ["SETTINGS", "Setting", "describe"]


def describe(id: int, value: float) -> tuple[str, str]:
    """Name and value with its unit; an id of a later version shows as its number."""
    setting = SETTINGS.get(id, Setting(f"setting {id}"))
    words = dict(enumerate(setting.words))
    if value in words:  # 1.0 finds the key 1
        return setting.name, words[int(value)]
    return setting.name, f"{value:g} {setting.unit}".strip()
