# SPDX-License-Identifier: MIT
"""Points of one picture found in another: corners, flow there and back, matches along the row.

Points are (n, 2) float32, u and v in px; `good` is a mask over them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pelorus.program.extras import cv2
from pelorus.tracking.images import Gray

from opencv_tracker.settings import Settings

Points = NDArray[np.float32]
Mask = NDArray[np.bool_]

LEVELS = 4  # of the pyramid: motion up to some 15 % of the width between two frames
STEPS, STEP_PX = 30, 0.005  # that end the refinement of a place
CELLS_ACROSS, CELLS_DOWN = 12, 4
QUALITY = 0.01  # of the strongest corner: in the shade too there shall be some
SEARCH_ROWS_PX, SEARCH_LEFT_PX = 1, 3  # room of the row search for errors of the rectification
PATCH_HALF_PX = 7
LIKENESS_MIN = 0.8  # normalised correlation of a row search
UNIQUE_RATIO = 0.9  # the second best place may be so much like the best
EPIPOLAR_POINTS_MIN = 15  # fewer cannot outvote each other
CONFIDENCE = 0.999


class Found(NamedTuple):
    """Where the points are, and which were found."""

    points: Points
    good: Mask


def none() -> Points:
    """No points."""
    return np.empty((0, 2), np.float32)


# --- corners --------------------------------------------------------------------------------------


def new_corners(image: Gray, taken: Points, settings: Settings) -> Points:
    """The strongest corners, cell by cell of a grid, until `taken` and they are settings.corners.

    Cells that hold few points choose first, so that the points spread over the picture.
    """
    wanted = settings.corners - len(taken)
    if wanted <= 0:
        return none()
    mask = np.full(image.shape, 255, np.uint8)
    for u, v in np.round(taken).astype(int).tolist():
        cv2.circle(mask, (u, v), round(settings.spacing_px), 0, -1)
    edge = settings.window_px // 2
    border = np.zeros_like(mask)
    border[edge:-edge, edge:-edge] = 255
    found: Any = cv2.goodFeaturesToTrack(  # None where there is no corner
        image, 0, QUALITY, settings.spacing_px, mask=cv2.bitwise_and(mask, border)
    )
    if found is None:
        return none()
    corners = np.asarray(found, np.float32).reshape(-1, 2)
    held = np.bincount(_cell(image, taken), minlength=CELLS_ACROSS * CELLS_DOWN)
    cell = _cell(image, corners)
    rank = held[cell] + _place_in_cell(cell)
    return corners[np.sort(np.argsort(rank, kind="stable")[:wanted])]


def _cell(image: Gray, points: Points) -> NDArray[np.intp]:
    rows, columns = image.shape
    across = np.clip(points[:, 0] * CELLS_ACROSS / columns, 0, CELLS_ACROSS - 1).astype(np.intp)
    down = np.clip(points[:, 1] * CELLS_DOWN / rows, 0, CELLS_DOWN - 1).astype(np.intp)
    cell: NDArray[np.intp] = down * CELLS_ACROSS + across
    return cell


def _place_in_cell(cell: NDArray[np.intp]) -> NDArray[np.intp]:
    """How many of the same cell come before each."""
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], cell[order])
    place = np.empty(len(cell), np.intp)
    place[order] = np.arange(len(cell)) - starts
    return place


# --- flow -----------------------------------------------------------------------------------------


def flow(
    source: Gray, target: Gray, points: Points, settings: Settings, guess: Points | None = None
) -> Found:
    """Lucas and Kanade, there and back: a point that does not come home is not good."""
    if not len(points):
        return Found(none(), np.zeros(0, np.bool_))
    there, seen = _lucas_kanade(source, target, points, settings, guess)
    back, seen_back = _lucas_kanade(target, source, there, settings, points)
    miss = np.linalg.norm(back - points, axis=1)
    good = seen & seen_back & (miss <= settings.round_trip_px) & inside(target, there, settings)
    return Found(there, good)


def _lucas_kanade(
    source: Gray, target: Gray, points: Points, settings: Settings, guess: Points | None
) -> Found:
    start = points.copy() if guess is None else guess.copy()
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        source,
        target,
        points.reshape(-1, 1, 2),
        start.reshape(-1, 1, 2),
        winSize=(settings.window_px, settings.window_px),
        maxLevel=LEVELS if guess is None else 1,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, STEPS, STEP_PX),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return Found(np.asarray(there, np.float32).reshape(-1, 2), status.ravel() == 1)


def inside(image: Gray, points: Points, settings: Settings) -> Mask:
    """Not so near the edge that the patch would leave the picture by half."""
    rows, columns = image.shape
    edge = settings.window_px / 4
    u, v = points.T
    found: Mask = (u >= edge) & (v >= edge) & (u <= columns - 1 - edge) & (v <= rows - 1 - edge)
    return found


def agreeing(before: Points, after: Points, settings: Settings) -> Mask:
    """RANSAC: the points whose motion one fundamental matrix explains; all, where few are there."""
    if len(before) < EPIPOLAR_POINTS_MIN:
        return np.ones(len(before), np.bool_)
    mask: Any = cv2.findFundamentalMat(
        before, after, cv2.FM_RANSAC, settings.epipolar_px, CONFIDENCE, maxIters=2000
    )[1]
    if mask is None:  # no motion explains them
        return np.ones(len(before), np.bool_)
    found: Mask = np.asarray(mask).ravel() == 1
    return found


# --- left and right -------------------------------------------------------------------------------


def match(
    left: Gray, right: Gray, points: Points, settings: Settings, guess: Points | None = None
) -> Found:
    """The left picture's points in the right one: sub-pixel, in the same row.

    Without a guess the row is searched for the most alike patch, which must stand alone.
    """
    sure = np.ones(len(points), np.bool_)
    if guess is None:
        guess, sure = _row_search(left, right, points, settings)
    there, good = flow(left, right, points, settings, guess)
    same_row = np.abs(there[:, 1] - points[:, 1]) <= settings.row_gap_px
    disparity = points[:, 0] - there[:, 0]
    possible = (disparity > -SEARCH_LEFT_PX) & (disparity <= disparity_max(left, settings))
    return Found(there, sure & good & same_row & possible)


def disparity_max(image: Gray, settings: Settings) -> int:
    """Of the settings, else an eighth of the width, in px."""
    return settings.disparity_max_px or image.shape[1] // 8


def _row_search(left: Gray, right: Gray, points: Points, settings: Settings) -> Found:
    guess, sure = points.copy(), np.zeros(len(points), np.bool_)
    reach = disparity_max(left, settings)
    rows, columns = left.shape
    half = PATCH_HALF_PX
    for k, (u, v) in enumerate(np.round(points).astype(int).tolist()):
        if not (half <= u < columns - half and half <= v < rows - half):
            continue
        patch = left[v - half : v + half + 1, u - half : u + half + 1]
        top, first = max(v - half - SEARCH_ROWS_PX, 0), max(u - half - reach, 0)
        bottom, last = v + half + SEARCH_ROWS_PX + 1, u + half + SEARCH_LEFT_PX + 1
        likeness = cv2.matchTemplate(right[top:bottom, first:last], patch, cv2.TM_CCOEFF_NORMED)
        by_column = likeness.max(axis=0)
        best = int(by_column.argmax())
        others = np.delete(by_column, slice(max(best - half // 2, 0), best + half // 2 + 1))
        second = float(others.max()) if len(others) else 0.0
        value = float(by_column[best])
        sure[k] = value >= LIKENESS_MIN and second <= UNIQUE_RATIO * value
        guess[k] = points[k, 0] + (first + best + half - u), points[k, 1]
    return Found(guess, sure)
