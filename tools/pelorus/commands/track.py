# SPDX-License-Identifier: MIT
"""`pelorus track LEFT RIGHT OUT.csv`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import typer
from rich.markup import escape

from pelorus.errors import PelorusError, resolved, whole, writing
from pelorus.eyes.front_end import CORNERS, Eyes, Shown
from pelorus.eyes.front_end import track as track_all
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times
from pelorus.native import vision
from pelorus.program.console import out, progress
from pelorus.tracking import images, sheet
from pelorus.tracking.images import Gray, Pair
from pelorus.tracking.row_gaps import TOLD_ABOVE_PX, row_gaps

EXAMPLE = "pelorus track image_l image_r stereo.csv --rate 10 --sheet tracks.png"

COLUMNS = "t_ns,id,uL_px,vL_px,uR_px,vR_px"

app = typer.Typer()


@app.command(epilog=f"Example:  {EXAMPLE}")
def track(
    left: Path = typer.Argument(..., metavar="LEFT", help="Folder of the left camera's pictures."),
    right: Path = typer.Argument(
        ..., metavar="RIGHT", help="Folder of the right one's; those of a frame have equal names."
    ),
    target: Path = typer.Argument(
        ..., metavar="OUT.csv", help="The tracks, for pelorus convert csv --stereo."
    ),
    times: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="A time in s a row, one for each pair, on the twists' clock. Without it and --rate "
        "the pictures' names are times in ns.",
    ),
    rate: float | None = typer.Option(
        None, metavar="HZ", help="Or: the first pair is at 0 s, and so many follow in a second."
    ),
    sheet_file: Path | None = typer.Option(
        None, "--sheet", metavar="OUT.png", help="Some frames with their tracks, to look at."
    ),
    corners: int = typer.Option(CORNERS, help="At most so many tracks in a frame."),
    disparity_max: int = typer.Option(
        0, metavar="PX", help="Largest uL - uR; 0 is a sixth of the picture's width."
    ),
) -> None:
    """Follow points through rectified stereo pictures (PNG, JPEG, PGM, BMP, TIFF).

    By the tracker that the robot runs (docs/EYES.md): the filter admits a track that is seen in
    three frames; shorter ones are written, too.
    """
    most = vision.limits().tracks
    if not 1 <= corners <= most:
        raise PelorusError(f"corners {corners}: 1 to {most} are possible in this build")
    if times is not None and rate is not None:
        raise typer.BadParameter("one of them, not both", param_hint="--times / --rate")
    _require_places(target, sheet_file)
    remarks: list[str] = []
    pairs = images.pairs(left, right, remarks if times is None and rate is None else None)
    t_ns = images.times(pairs, times, rate)
    shown: dict[int, Gray] = {}
    bits = images.bits_of(pairs, remarks)
    for remark in remarks:
        out.print(escape(remark))
    first, _ = images.read(pairs[0], bits=bits)
    size = first.shape[1], first.shape[0]
    if not 0 <= disparity_max <= size[0]:
        raise PelorusError(
            f"disparity-max {disparity_max}: 0 to {size[0]}, the width of the pictures, is expected"
        )
    eyes = Eyes(None, size, corners=corners, disparity_max_px=disparity_max)
    shown_pairs = zip(t_ns.tolist(), _read(pairs, bits, shown), strict=True)
    tracks = track_all((Shown(t, *pair) for t, pair in shown_pairs), eyes, (left, right))
    files = {target: _csv_text(t_ns, tracks).encode()}
    if sheet_file is not None:
        files[sheet_file] = sheet.sheet(shown, [pair.left.name for pair in pairs], tracks)
    _write_all(files)
    _say(target, tracks)


def _require_places(target: Path, sheet_file: Path | None) -> None:
    """Refuses bad outputs before the work, not after it."""
    for path in (target, sheet_file):
        if path is not None and not path.parent.is_dir():
            raise PelorusError(f"{path}: cannot be written: there is no folder {path.parent}")
    if sheet_file is not None and resolved(sheet_file) == resolved(target):
        raise PelorusError(f"{target}: is given for the tracks and for the sheet; two are expected")


def _read(pairs: list[Pair], bits: int, shown: dict[int, Gray]) -> Iterator[tuple[Gray, Gray]]:
    """Yields the pairs; the left pictures of the sheet stay in `shown`."""
    wanted = set(sheet.chosen(len(pairs)))
    for k, (left, right) in enumerate(
        images.in_order(progress(pairs, "tracking", len(pairs)), bits)
    ):
        if k in wanted:
            shown[k] = left
        yield left, right


def _csv_text(t_ns: Times, tracks: Tracks) -> str:
    """Returns a row for each observation; pixels to a thousandth."""
    rows = zip(t_ns[tracks.frame].tolist(), tracks.id.tolist(), tracks.pixels.tolist(), strict=True)
    lines = [f"{t},{id},{','.join(f'{p:.3f}' for p in pixels)}" for t, id, pixels in rows]
    return "\n".join([COLUMNS, *lines, ""])


def _write_all(files: Mapping[Path, bytes]) -> None:
    """Writes all of them whole, or none of them anew."""
    with whole(*files) as parts:
        for (path, content), part in zip(files.items(), parts, strict=True):
            with writing(path):
                if path.is_dir():
                    raise IsADirectoryError(21, "is a folder")
                part.write_bytes(content)


def _say(target: Path, tracks: Tracks) -> None:
    lengths = np.bincount(tracks.id)
    counts = tracks.counts()
    out.print(
        f"{escape(str(target))}: {tracks.frame_count} frames with {len(tracks)} observations of "
        f"{len(lengths)} tracks; a frame shows {np.median(counts):.0f} "
        f"({counts.min()} to {counts.max()}), a track lives {np.median(lengths):.0f} frames "
        f"({lengths.min()} to {lengths.max()})"
    )
    empty = np.nonzero(counts == 0)[0]
    if len(empty):
        out.print(
            f"    -> frames without any track: {len(empty)}, the first is frame {empty[0]} "
            "(counted from 0); they are not in the file"
        )
    gaps = row_gaps(tracks)
    if gaps is not None and gaps.smooth_px > TOLD_ABOVE_PX:
        out.print(
            f"    -> rectification: the rows of left and right differ by {gaps.smooth_px:.2f} px "
            f"RMS, smoothly over the picture and up to {gaps.largest_px:.1f} px, beside "
            f"{gaps.rest_px:.2f} px from match to match: the calibration is off by that, and a "
            f"pixel-sigma of {gaps.stands_for_px(float(np.median(counts))):.2g} stands for it"
        )
