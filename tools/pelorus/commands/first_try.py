# SPDX-License-Identifier: MIT
"""`pelorus try SAMPLE`: from what somebody has to a verdict."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import typer

from pelorus.commands.outputs import run_command
from pelorus.errors import Existing, PelorusError, made, resolved
from pelorus.program.console import step, steps

STEPS_OF_CHECK, STEPS_OF_REPORT = 5, 3  # theirs load slowly
RECORDINGS = (".plr", ".plr.zst")
BAGS = (".bag", ".mcap", ".db3")

app = typer.Typer()


def _has(*names: str) -> Callable[[Path], bool]:
    """Returns a test whether a folder holds one of these names."""
    return lambda source: source.is_dir() and any((source / name).exists() for name in names)


def _archive_with(name: str) -> Callable[[Path], bool]:
    """Returns a test whether a .npz holds this array."""

    def holds(source: Path) -> bool:
        if source.suffix != ".npz" or not zipfile.is_zipfile(source):
            return False
        with zipfile.ZipFile(source) as archive:
            return f"{name}.npy" in archive.namelist()

    return holds


# Formats of `pelorus convert`, each with a test of the content. The first that holds counts.
FORMATS: tuple[tuple[str, str, Callable[[Path], bool]], ...] = (
    ("ros", f"a bag ({', '.join(BAGS)})", lambda source: source.suffix in BAGS),
    ("ros", "a bag's folder (metadata.yaml)", _has("metadata.yaml")),
    ("euroc", "a folder like EuRoC's (mav0)", _has("mav0", "cam0")),
    ("kitti", "a drive of KITTI (oxts, or calib.txt)", _has("oxts", "calib.txt")),
    ("imu-npz", "a .npz with an IMU", _archive_with("stereo_px")),
)


def _format_of(source: Path) -> str:
    """Returns the format's name in `pelorus convert`; empty for a recording."""
    if source.is_file() and source.name.endswith(RECORDINGS):
        return ""
    for name, _, fits in FORMATS:
        if fits(source):
            return name
    if not source.exists():
        raise PelorusError(f"{source}: is not there")
    known = "; ".join(what for _, what, _ in FORMATS)
    raise PelorusError(
        f"{source}: is nothing that is known by its looks: a recording (.plr), {known}. For other "
        "data pelorus convert has a command for each format: docs/CONVERT.md"
    )


@app.command(
    name="try",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    epilog="Example:  pelorus try V1_01_easy --calibration camchain.yaml",
)
def first_try(
    context: typer.Context,
    source: Path = typer.Argument(
        ..., metavar="SAMPLE", help="A recording, a bag, or a folder of a known data set."
    ),
    folder: Path | None = typer.Option(
        None, "--out", metavar="DIR", help="Where all goes; else try-NAME here."
    ),
) -> None:
    """Convert a sample if need be, check it, and draw the report: to see what is to be had of it.

    Options that are not known here are for the conversion. The exit status is 1 if a fault stands
    in the way: then the report is drawn with the settings as they are.
    """
    force = ("--force",) if Existing.overwritten else ()  # each command asks for itself
    kind = _format_of(source)
    name = source.name.removesuffix(".zst").removesuffix(".plr") or resolved(source).name
    into = made(folder or Path(f"try-{name}"))
    with steps(bool(kind) + STEPS_OF_CHECK + STEPS_OF_REPORT):
        status = _all(source, kind, name, into, context.args, force)
    if status:
        raise typer.Exit(status)


def _all(
    source: Path, kind: str, name: str, into: Path, own: list[str], force: tuple[str, ...]
) -> int:
    """Returns the exit status."""
    recording = source
    if kind:
        step("converting")
        recording = into / f"{name}.plr"
        if status := run_command("convert", kind, str(source), str(recording), *own, *force):
            return status
    elif own:
        raise PelorusError(f"{' '.join(own)}: {source} needs no conversion")
    tuned = into / "tuned.conf"
    status = run_command("check", str(recording), "--out", str(tuned), *force)
    settings = ("--config", str(tuned)) if status == 0 and tuned.is_file() else ()
    run_command("report", str(recording), "--out", str(into), *settings, *force)
    return status
