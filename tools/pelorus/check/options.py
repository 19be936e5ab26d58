# SPDX-License-Identifier: MIT
"""Settings as `check` passes them about, and as pelorus-replay takes them."""

from __future__ import annotations

from collections.abc import Mapping

Settings = Mapping[str, str]


def options_of(settings: Settings) -> list[str]:
    """As pelorus-replay takes them."""
    return [word for name, value in settings.items() for word in (f"--{name}", value)]
