# SPDX-License-Identifier: MIT
"""`pelorus map RECORDING|RESULT --out DIR`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.markup import escape

from pelorus.commands.choices import CONFIG, PROGRAMS, SETTINGS, replay_options
from pelorus.errors import Existing
from pelorus.grid import files, occupancy
from pelorus.grid.occupancy import Band, Grid, Wish
from pelorus.grid.sightings import sightings
from pelorus.native.replay import result_of
from pelorus.program.console import err, out, print_json
from pelorus.program.extras import figures_missing

app = typer.Typer()


@app.command(
    "map",
    epilog="Example:  pelorus map drive.plr --config robot.conf --out out/map --height -0.3 3",
)
def map_(
    source: Path = typer.Argument(
        ..., metavar="RECORDING|RESULT", help="A recording, or what a filter left of it."
    ),
    folder: Path = typer.Option(
        ..., "--out", metavar="DIR", help="Where map.pgm, map.yaml and map.png go."
    ),
    resolution: float | None = typer.Option(
        None,
        metavar="M",
        help="Side of a cell; else as fine as the landmarks are certain and a long drive allows.",
    ),
    height: tuple[float, float] | None = typer.Option(
        None,
        metavar="LOW HIGH",
        help="Heights about the body that count, m; else -0.3 to 4, or all where the body's axes "
        "do not say what is up.",
    ),
    range_: float = typer.Option(
        Wish.range_m, "--range", metavar="M", help="Greatest distance from the camera that counts."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    as_json: bool = typer.Option(False, "--json", help="What it tells as one JSON object."),
    programs: Path | None = PROGRAMS,
) -> None:
    """Draw the map of a drive: where it is free, where something stands.

    A 2-D occupancy grid from the rays between camera and landmarks, weighted by the landmarks'
    covariance. The pair map.pgm, map.yaml is what nav2's map_server reads. A recording is
    replayed first.
    """
    Existing.keep(folder / files.TEXT)
    wish = _wish(resolution, height, range_)
    messages = result_of(source, replay_options(config, settings), programs)
    seen = sightings(source, messages)
    grid = occupancy.occupancy(seen, wish)
    _publish(grid, f"{seen.name}: {files.heights(grid.band)}", folder)
    if as_json:
        print_json(_json(grid, folder))
    else:
        _tell(grid, folder)


def _wish(resolution: float | None, height: tuple[float, float] | None, range_m: float) -> Wish:
    if resolution is not None and not (math.isfinite(resolution) and resolution > 0):
        raise typer.BadParameter(
            f"{resolution:g} m is no side of a cell; it must be positive", param_hint="--resolution"
        )
    if not (math.isfinite(range_m) and range_m > 0):
        raise typer.BadParameter(
            f"{range_m:g} m is no distance; it must be positive", param_hint="--range"
        )
    if height is not None and not height[0] < height[1]:
        raise typer.BadParameter(
            f"{height[0]:g} {height[1]:g} is no band: first the lower height, then the higher one",
            param_hint="--height",
        )
    return Wish(resolution, None if height is None else Band(*height), range_m)


def _publish(grid: Grid, title: str, folder: Path) -> None:
    if missing := figures_missing():
        err.print(escape(f"the map has no {files.PICTURE}: {missing}"))
        files.write(folder, grid, None)
        return
    from pelorus.grid import picture  # noqa: PLC0415 - as above
    from pelorus.program import style  # noqa: PLC0415 - an extra

    files.write(folder, grid, lambda path: style.save(lambda: picture.draw(grid, title), path))


def _counts(grid: Grid) -> dict[str, int]:
    found = files.cells(grid)
    kinds = {"free": files.FREE, "occupied": files.OCCUPIED, "unknown": files.UNKNOWN}
    return {name: int(np.sum(found == kind)) for name, kind in kinds.items()}


def _json(grid: Grid, folder: Path) -> dict[str, Any]:
    height, width = grid.log_odds.shape
    return {
        "map": str(folder / files.TEXT),
        "resolution_m": grid.resolution_m,
        "width": width,
        "height": height,
        "origin_m": grid.origin_m,
        "right": grid.plane.right.name,
        "up": grid.plane.up.name,
        "heights_m": grid.band,
        **_counts(grid),
        "landmarks": grid.landmarks,
    }


def _tell(grid: Grid, folder: Path) -> None:
    height, width = grid.log_odds.shape
    x, y = grid.origin_m
    out.print(
        f"{width} x {height} cells of {grid.resolution_m:g} m, {files.heights(grid.band)}: "
        "{free} free, {occupied} occupied, {unknown} not known; ".format(**_counts(grid))
        + f"{grid.landmarks} landmarks stand in it"
    )
    right, up = grid.plane.right.label, grid.plane.up.label
    out.print(f"lower left corner at ({x:g}, {y:g}); to the right {right}, upwards {up}")
    out.print(f"map: {escape(str(folder / files.TEXT))}")
