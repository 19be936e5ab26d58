# SPDX-License-Identifier: MIT
"""Whether the pictures are those of a rectified pair: left is left, and a point keeps its row.

Corners of some left pictures are looked for in the right ones, in many rows and to both sides, and
counted by where their one most alike place is. Only those that can be known again: which have no
like in their own picture, and are found in the left one before. The same search in the right
picture upside down, which shows none of them, says how many are chance. Nothing that the tracker
did plays a part: how many of its corners find a match depends on the scene, and in a standing
camera's it asks for the same ones again in every frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.program.extras import cv2
from pelorus.tracking.images import Gray

CORNERS = 40  # of a picture
QUALITY = 0.01  # of the strongest corner: in the shade too there shall be some
CORNERS_APART_PX = 20.0
CELLS_ACROSS, CELLS_DOWN = 12, 4  # over which the corners are spread
HALF = 7  # of a patch, px
LIKENESS_MIN = 0.8  # normalised correlation
UNIQUE_RATIO = 0.9  # the second best place may be so much like the best
ROW_GAP_PX = 1.5  # of a point in a rectified pair
LEFT_PX = 3  # so much further right a far point may be
REACH_SHARE = 6  # of the width: the largest disparity that is searched, as eyes do
ROWS_PX = 32  # up and down; a point of a pair that is nearly rectified is within
# Of the places that are searched those of a rectified pair.
PAIR_SHARE = (2 * int(ROW_GAP_PX) + 1) / (2 * ROWS_PX + 1) * 0.5
SIGMAS = 3.0
CHANCE = 1.3e-3  # as far off as three sigma, on one side


@dataclass
class Seen:
    """How many of the corners a right picture shows where."""

    as_due: int = 0  # in the same row, further left or as far away
    swapped: int = 0  # in the same row, further right
    rows_off_px: list[float] = field(default_factory=list)  # of those in other rows: lower

    @property
    def elsewhere(self) -> int:
        return len(self.rows_off_px)

    def count(self, found: tuple[int, int] | None) -> None:
        """A corner, `found` so much further right and lower; None: nowhere for sure."""
        if found is None:
            return
        right_px, lower_px = found
        if abs(lower_px) > ROW_GAP_PX:
            self.rows_off_px.append(lower_px)
        elif right_px <= LEFT_PX:
            self.as_due += 1
        else:
            self.swapped += 1


@dataclass
class Evidence:
    """Of some frames, each of twice the number of the one before, for a scene may stand still; the
    number of the `first` is a power of two."""

    disparity_max_px: int = 0  # 0: a share of the width
    first: int = 1
    corners: int = 0
    seen: Seen = field(default_factory=Seen)
    chance: Seen = field(default_factory=Seen)
    _frames: int = 0
    _before: Gray | None = None

    def add(self, left: Gray, right: Gray) -> None:
        """The next frame."""
        if self._before is not None and self._is_looked_at(self._frames):
            self._look(self._before, left, right)
        self._before = left
        self._frames += 1

    @property
    def needs_next(self) -> bool:
        """Returns whether the next frame is looked at, or is the one before such a frame; others
        may be left out by `skip`."""
        return self._is_looked_at(self._frames) or self._is_looked_at(self._frames + 1)

    def skip(self) -> None:
        """Lets the next frame pass."""
        self._frames += 1

    def _is_looked_at(self, number: int) -> bool:
        return number >= self.first and number & (number - 1) == 0

    def _look(self, before: Gray, left: Gray, right: Gray) -> None:
        mirrored = np.ascontiguousarray(np.flipud(right))
        rows, columns = left.shape
        reach = self.disparity_max_px or columns // REACH_SHARE
        for u, v in np.round(_corners(left)).astype(int).tolist():
            inside = HALF <= u < columns - HALF and HALF <= v < rows - HALF
            if not inside or not all(_most_alike(left, p, (u, v), reach) for p in (left, before)):
                continue
            self.corners += 1
            for picture, counts in ((right, self.seen), (mirrored, self.chance)):
                counts.count(_most_alike(left, picture, (u, v), reach))

    def require_rectified(self, where: tuple[Path, Path]) -> None:
        """PelorusError where another relation of the two cameras explains what is seen."""
        seen, chance = self.seen, self.chance
        shows = f"{where[1]}: of {self.corners} corners of {where[0]} it shows"
        if _more(seen.swapped, seen.as_due + chance.swapped):
            raise PelorusError(
                f"{shows} {seen.swapped} in the same row but further right, {seen.as_due} further "
                "left, as a rectified pair would; are left and right swapped, or is the transform "
                "between the cameras (T_cn_cnm1; R, T) the inverse?"
            )
        if _more(seen.elsewhere, seen.as_due + chance.elsewhere):
            raise PelorusError(
                f"{shows} {seen.elsewhere} in other rows ({np.median(seen.rows_off_px):+.0f} rows "
                f"lower in the median), {seen.as_due} in the same, as a rectified pair would; are "
                "they rectified, is the calibration theirs, is the transform between the cameras "
                "(T_cn_cnm1; R, T) the inverse?"
            )
        found = seen.as_due + seen.swapped + seen.elsewhere
        if _more(self.corners, found) and _tail(seen.as_due, found, PAIR_SHARE) > CHANCE:
            raise PelorusError(
                f"{shows} {seen.as_due} in the same row, no more than by chance; pictures of a "
                "rectified pair that were taken together are expected (is one camera covered, is "
                "the largest disparity too small?)"
            )


def _corners(image: Gray) -> NDArray[np.float32]:
    """Returns (n, 2) the strongest corners, those of each cell of a grid in turn."""
    inner = np.zeros_like(image)
    inner[HALF:-HALF, HALF:-HALF] = 255
    found: Any = cv2.goodFeaturesToTrack(image, 0, QUALITY, CORNERS_APART_PX, mask=inner)
    if found is None:  # there is none
        return np.empty((0, 2), np.float32)
    corners = np.asarray(found, np.float32).reshape(-1, 2)
    rows, columns = image.shape
    share = corners / [columns, rows] * [CELLS_ACROSS, CELLS_DOWN]
    across, down = np.minimum(share.astype(int), [CELLS_ACROSS - 1, CELLS_DOWN - 1]).T
    cell = (down * CELLS_ACROSS + across).tolist()
    place = [cell[:k].count(one) for k, one in enumerate(cell)]
    return corners[np.sort(np.argsort(place, kind="stable")[:CORNERS])]


def _most_alike(left: Gray, other: Gray, at: tuple[int, int], reach: int) -> tuple[int, int] | None:
    """By how much further right and lower the other picture shows what the left one has there;
    None where it does not, or in more places than one.
    """
    u, v = at
    patch = left[v - HALF : v + HALF + 1, u - HALF : u + HALF + 1]
    top, first = max(v - HALF - ROWS_PX, 0), max(u - HALF - reach, 0)
    area = other[top : v + HALF + ROWS_PX + 1, first : u + HALF + reach + 1]
    likeness = cv2.matchTemplate(area, patch, cv2.TM_CCOEFF_NORMED)
    row, column = divmod(int(likeness.argmax()), likeness.shape[1])
    best, near = float(likeness[row, column]), HALF // 2
    likeness[max(row - near, 0) : row + near + 1, max(column - near, 0) : column + near + 1] = -1
    if best < LIKENESS_MIN or likeness.max() > UNIQUE_RATIO * best:
        return None
    return first + column + HALF - u, top + row + HALF - v


def _more(count: int, others: int) -> bool:
    """Beyond what chance makes of two equal counts."""
    return count - others > SIGMAS * float(np.sqrt(count + others))


def _tail(count: int, of: int, share: float) -> float:
    """The chance that so many or more of some, each with this chance, are counted."""
    return sum(math.comb(of, k) * share**k * (1 - share) ** (of - k) for k in range(count, of + 1))
