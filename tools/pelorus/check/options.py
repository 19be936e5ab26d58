# SPDX-License-Identifier: MIT
"""Settings as `check` keeps them, and as pelorus-replay takes them."""

from __future__ import annotations

from collections.abc import Mapping

Settings = Mapping[str, str]


def options_of(settings: Settings) -> list[str]:
    """Returns the settings as arguments of pelorus-replay."""
    return [word for name, value in settings.items() for word in (f"--{name}", value)]
