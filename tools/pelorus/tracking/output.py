# SPDX-License-Identifier: MIT
"""What pelorus track writes: the CSV that `pelorus convert csv --stereo` reads, and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pelorus.errors import whole, writing
from pelorus.io.tracks import Tracks
from pelorus.math.motion import Times

COLUMNS = "t_ns,id,uL_px,vL_px,uR_px,vR_px"


def csv_text(t_ns: Times, tracks: Tracks) -> str:
    """A row an observation; pixels to a thousandth."""
    rows = zip(t_ns[tracks.frame].tolist(), tracks.id.tolist(), tracks.pixels.tolist(), strict=True)
    lines = [f"{t},{id},{','.join(f'{p:.3f}' for p in pixels)}" for t, id, pixels in rows]
    return "\n".join([COLUMNS, *lines, ""])


def write_all(files: Mapping[Path, bytes]) -> None:
    """All of them whole, or none of them anew."""
    with whole(*files) as parts:
        for (path, content), part in zip(files.items(), parts, strict=True):
            with writing(path):
                if path.is_dir():
                    raise IsADirectoryError(21, "is a folder")
                part.write_bytes(content)
