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
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pelorus.errors import PelorusError
from pelorus.program.extras import cv2
from pelorus.tracking import matching
from pelorus.tracking.images import Gray
from pelorus.tracking.settings import Settings

CORNERS = 40  # of a picture
HALF = matching.PATCH_HALF_PX
ROWS_PX = 32  # up and down; a point of a pair that is nearly rectified is within
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

    def count(self, found: tuple[int, int] | None, row_gap_px: float) -> None:
        """A corner, `found` so much further right and lower; None: nowhere for sure."""
        if found is None:
            return
        right_px, lower_px = found
        if abs(lower_px) > row_gap_px:
            self.rows_off_px.append(lower_px)
        elif right_px <= matching.SEARCH_LEFT_PX:
            self.as_due += 1
        else:
            self.swapped += 1


@dataclass
class Evidence:
    """Of some frames, each of twice the number of the one before, for a scene may stand still; the
    number of the `first` is a power of two."""

    settings: Settings
    first: int = 1
    corners: int = 0
    seen: Seen = field(default_factory=Seen)
    chance: Seen = field(default_factory=Seen)
    _frames: int = 0
    _before: Gray | None = None
    _share: float = 1.0  # of the places that are searched: those of a rectified pair

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
        gap_px, reach = self.settings.row_gap_px, matching.disparity_max(left, self.settings)
        self._share = (2 * int(gap_px) + 1) / (2 * ROWS_PX + 1) * 0.5
        few = replace(self.settings, corners=CORNERS)
        for u, v in np.round(matching.new_corners(left, matching.none(), few)).astype(int).tolist():
            inside = HALF <= u < columns - HALF and HALF <= v < rows - HALF
            if not inside or not all(_most_alike(left, p, (u, v), reach) for p in (left, before)):
                continue
            self.corners += 1
            for picture, counts in ((right, self.seen), (mirrored, self.chance)):
                counts.count(_most_alike(left, picture, (u, v), reach), gap_px)

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
        if _more(self.corners, found) and _tail(seen.as_due, found, self._share) > CHANCE:
            raise PelorusError(
                f"{shows} {seen.as_due} in the same row, no more than by chance; pictures of a "
                "rectified pair that were taken together are expected (is one camera covered, "
                "is the "
                "largest disparity too small?)"
            )


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
    if best < matching.LIKENESS_MIN or likeness.max() > matching.UNIQUE_RATIO * best:
        return None
    return first + column + HALF - u, top + row + HALF - v


def _more(count: int, others: int) -> bool:
    """Beyond what chance makes of two equal counts."""
    return count - others > SIGMAS * float(np.sqrt(count + others))


def _tail(count: int, of: int, share: float) -> float:
    """The chance that so many or more of some, each with this chance, are counted."""
    return sum(math.comb(of, k) * share**k * (1 - share) ** (of - k) for k in range(count, of + 1))
