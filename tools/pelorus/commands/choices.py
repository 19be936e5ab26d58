# SPDX-License-Identifier: MIT
"""Words that options take, and what they stand for."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import typer

from pelorus.frames import TwistTiming

CONFIG = typer.Option(
    None, metavar="FILE", help="For a recording: settings, as pelorus-replay takes them."
)
SETTINGS = typer.Option(
    [], "--set", metavar="NAME=VALUE", help="One setting more, for example bias=on; repeatable."
)
PROGRAMS = typer.Option(
    None, "--bin", metavar="DIR", help="Where the replays are; else PELORUS_BIN, build/bin."
)


class Fix(StrEnum):
    """Whether a converter mends what it finds."""

    AUTO = "auto"
    NONE = "none"


class Timing(StrEnum):
    """The twist timings of HEADER by name."""

    START = "start"
    END = "end"
    MID = "mid"

    @property
    def value_in_header(self) -> TwistTiming:
        return TwistTiming[self.name]


class TimingOrAuto(StrEnum):
    """As Timing, or decided from the data."""

    AUTO = "auto"
    START = "start"
    END = "end"
    MID = "mid"

    @property
    def value_in_header(self) -> TwistTiming | None:
        return None if self is TimingOrAuto.AUTO else TwistTiming[self.name]


def replay_options(config: Path | None, settings: list[str], hint: str = "--set") -> list[str]:
    """What --config and NAME=VALUE become on the command line of pelorus-replay."""
    options = [] if config is None else ["--config", str(config)]
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"{setting!r} is not NAME=VALUE", param_hint=hint)
        options += [f"--{name}", value]
    return options
