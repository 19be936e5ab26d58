# SPDX-License-Identifier: MIT
"""The contact sheet: some frames of the drive with their tracks drawn in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.io.tracks import Tracks
from pelorus.program.extras import cv2
from pelorus.tracking.images import Gray

Picture = NDArray[np.uint8]

FRAMES_MAX, ACROSS = 12, 2
WIDTH_PX = 800  # of one frame
TAIL_FRAMES = 5
GAP_PX, CAPTION_PX = 6, 26
WHITE = (255, 255, 255)


def chosen(count: int) -> list[int]:
    """The frames to show, evenly spread, the last among them; not the first: it has no tail yet."""
    return sorted(
        {round(k) for k in np.linspace(min(TAIL_FRAMES, count - 1), count - 1, FRAMES_MAX)}
    )


def sheet(images: dict[int, Gray], names: Sequence[str], tracks: Tracks) -> bytes:
    """A PNG: each dot a point, warm near and cold far, with its way through the last frames."""
    spread = tracks.pixels[:, 0] - tracks.pixels[:, 2]
    nearest = max(float(np.percentile(spread, 95)), 1.0)
    tiles = [_tile(image, k, names[k], tracks, nearest) for k, image in sorted(images.items())]
    blank = np.zeros_like(tiles[0])
    rows = [tiles[k : k + ACROSS] for k in range(0, len(tiles), ACROSS)]
    rows[-1] += [blank] * (min(ACROSS, len(tiles)) - len(rows[-1]))
    good, png = cv2.imencode(".png", np.vstack([np.hstack(row) for row in rows]))
    if not good:
        raise PelorusError("the contact sheet cannot be packed as PNG")
    return png.tobytes()


def _tile(image: Gray, frame: int, name: str, tracks: Tracks, nearest: float) -> Picture:
    scale = WIDTH_PX / image.shape[1]
    size = (WIDTH_PX, round(image.shape[0] * scale))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.cvtColor(cv2.resize(image, size, interpolation=how), cv2.COLOR_GRAY2BGR))
    bounds = tracks.bounds()
    now = range(int(bounds[frame]), int(bounds[frame + 1]))
    tails = _tails(tracks, bounds, frame)
    for row in now:
        u, _, u_right, _ = tracks.pixels[row]
        warm = np.clip((u - u_right) / nearest, 0, 1) * 255
        shade = cv2.applyColorMap(np.array([[warm]], np.uint8), cv2.COLORMAP_TURBO)[0, 0]
        colour = tuple(int(c) for c in shade)
        way = np.round(np.array(tails[int(tracks.id[row])]) * scale).astype(np.int32)
        cv2.polylines(tile, [way.reshape(-1, 1, 2)], False, colour, 1, cv2.LINE_AA)
        cv2.circle(tile, (int(way[-1, 0]), int(way[-1, 1])), 3, colour, -1, cv2.LINE_AA)
    caption = np.zeros((CAPTION_PX, WIDTH_PX, 3), np.uint8)
    words = f"{name}: {len(now)} tracks; warm is near, cold is far; line: last {TAIL_FRAMES} frames"
    cv2.putText(caption, words, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, WHITE, 1, cv2.LINE_AA)
    framed = np.vstack((caption, tile))
    return np.asarray(np.pad(framed, ((0, GAP_PX), (0, GAP_PX), (0, 0))), np.uint8)


def _tails(tracks: Tracks, bounds: NDArray[np.int64], frame: int) -> dict[int, list[list[float]]]:
    """Where each id was in the left picture, oldest first, up to this frame."""
    tails: dict[int, list[list[float]]] = {}
    first = int(bounds[max(frame - TAIL_FRAMES, 0)])
    for row in range(first, int(bounds[frame + 1])):
        tails.setdefault(int(tracks.id[row]), []).append(tracks.pixels[row, :2].tolist())
    return tails
