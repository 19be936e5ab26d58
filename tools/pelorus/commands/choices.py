# SPDX-License-Identifier: MIT
"""Words that options take, and their values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path

import typer

from pelorus.errors import Existing, PelorusError, read_text
from pelorus.wire import schema
from pelorus.wire.frames import Message, TwistTiming
from pelorus.wire.settings import IDS

LOG: Path = typer.Argument(
    ...,
    metavar="LOG.plr",
    help="What `pelorus-replay --out` or `pelorus stream --record` wrote; a recording is replayed "
    "first.",
)
CONFIG = typer.Option(
    None, metavar="FILE", help="Settings of a replay, as pelorus-replay takes them."
)
SETTINGS = typer.Option(
    [], "--set", metavar="NAME=VALUE", help="One setting more, for example bias=on; repeatable."
)
PICTURES = typer.Option(
    None,
    metavar="FOLDER|BAG",
    help="On the page: pictures of the moments that matter, with tracks and residuals. What the "
    "recording was converted from; or a folder of the left camera's rectified pictures, named by "
    "their times in ns, or one a frame.",
)
CALIBRATION = typer.Option(
    [],
    "--calibration",
    metavar="FILE",
    help="Of --pictures that do not bring their own, as for pelorus convert; repeatable.",
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
    """Returns --config and NAME=VALUE as options of pelorus-replay."""
    options = [] if config is None else ["--config", str(config)]
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"{setting!r} is not NAME=VALUE", param_hint=hint)
        options += [f"--{name}", value]
    return options


def settings_given(config: Path | None, settings: list[str]) -> dict[str, str]:
    """Returns a config file and NAME=VALUE as one dictionary; later ones override earlier ones."""
    given = {}
    if config is not None:
        for number, line in enumerate(read_text(config).splitlines(), 1):
            words = line.partition("#")[0].strip()
            name, equals, value = (part.strip() for part in words.partition("="))
            if words and not (name and equals and value):
                raise PelorusError(f"{config}: line {number}: {words!r} is not name = value")
            if words:
                given[name] = value
    options = replay_options(None, settings)
    pairs = zip(options[::2], options[1::2], strict=True)
    given |= {name.removeprefix("--"): value for name, value in pairs}
    for name, value in given.items():
        _require_words(name, value, config)
    return given


def _require_words(name: str, value: str, config: Path | None) -> None:
    """Refuses a word that a setting of words does not have; the replay checks numbers."""
    setting = schema.SETTINGS[IDS[name]] if name in IDS else None
    if setting is None or not setting.words:
        return
    asked = [] if setting.is_list and value == "off" else value.split(",")
    if not set(asked) <= set(setting.words) or (len(asked) > 1 and not setting.is_list):
        where = f"{config} or --set" if config else "--set"
        raise PelorusError(
            f"{where}: {name} = {value}: {', '.join(setting.words)} are possible"
            + (", some of them between commas, or off" * setting.is_list)
        )


# --- live views -----------------------------------------------------------------------------------


VIEW = typer.Option(
    None,
    "--view",
    metavar="spawn|URL|OUT.rrd",
    help="Show it in Rerun while it runs: in a viewer that is started, one that runs already, "
    "or a file; as pelorus view does of a log.",
)


@contextmanager
def watching(where: str | None) -> Iterator[Callable[[Message], None]]:
    """Gives what takes each message of inputs and answers, in their order."""
    if where is None:
        yield lambda _: None
        return
    from pelorus.view.drive import ShownDrive  # noqa: PLC0415 - scipy loads slowly
    from pelorus.view.in_rerun import InRerun  # noqa: PLC0415

    file = Path(where) if where.endswith(".rrd") else None
    if file is not None:
        Existing.keep(file)
    spawn = where == "spawn"
    drive = ShownDrive([InRerun(file, None if spawn or file else where, spawn)])
    try:
        yield drive.take
    finally:
        drive.end()
