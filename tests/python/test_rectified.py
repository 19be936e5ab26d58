# SPDX-License-Identifier: MIT
"""What pictures show of left and right, of rows, and of nothing: of a wall seen by two cameras."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from followed_pairs import followed_in
from pelorus.errors import PelorusError
from pelorus.io.tracks import Tracks
from pelorus.tracking.images import Gray
from rendered import texture

WIDTH, HEIGHT, DISPARITY_PX = 320, 160, 17
FRAMES, STEP_PX = 12, 2
FEW = 50
Pair = tuple[Gray, Gray]


def followed(pairs: list[Pair]) -> Tracks:
    """Returns the tracks as pelorus track makes them."""
    return followed_in(pairs, FEW)


def wall(seed: int, frame: int = 0) -> Pair:
    """A camera that moves along it."""
    shade = texture(seed).astype(np.uint8)
    at = 100 + STEP_PX * frame
    rows = slice(200, 200 + HEIGHT)
    right = at + DISPARITY_PX
    return shade[rows, at : at + WIDTH].copy(), shade[rows, right : right + WIDTH].copy()


def drive(harm: Callable[[Gray, Gray], Pair], standing: bool = False) -> list[Pair]:
    return [harm(*wall(4, 0 if standing else k)) for k in range(FRAMES)]


def as_it_is(left: Gray, right: Gray) -> Pair:
    return left, right


def mostly_hidden(left: Gray, right: Gray) -> Pair:
    """The right camera sees a quarter of what the left one sees, and beside it something else."""
    right[:, WIDTH // 4 :] = wall(9)[1][:, WIDTH // 4 :]
    return left, right


def fence(left: Gray, right: Gray) -> Pair:
    """Alike posts all over the picture, and a little between them."""
    posts = np.tile(np.repeat([60, 200], 14), WIDTH)[: WIDTH + 14].astype(np.uint8)
    left[:120], right[:120] = posts[:WIDTH], posts[3 : 3 + WIDTH]
    return left, right


def dim(left: Gray, right: Gray) -> Pair:
    """Returns the pair as a poor sensor sees it, the right picture darker."""
    chance = np.random.default_rng(int(left.sum()))
    shades = left.astype(float), 40 + 0.6 * right.astype(float)
    one, other = (np.clip(s + chance.normal(0, 11, s.shape), 0, 255) for s in shades)
    return one.astype(np.uint8), other.astype(np.uint8)


def swapped(left: Gray, right: Gray) -> Pair:
    return right, left


def turned(left: Gray, right: Gray) -> Pair:
    """One camera is rolled by 3 degrees."""
    turn = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 3.0, 1.0)
    return left, np.asarray(cv2.warpAffine(right, turn, (WIDTH, HEIGHT)), np.uint8)


def lower(left: Gray, right: Gray) -> Pair:
    return left, np.roll(right, 11, axis=0)


def another(left: Gray, _right: Gray) -> Pair:
    return left, wall(7)[1]


def covered(left: Gray, right: Gray) -> Pair:
    return left, np.full_like(right, 12)


@pytest.mark.parametrize("harm", [as_it_is, mostly_hidden, fence, dim])
@pytest.mark.parametrize("standing", [False, True])
def test_a_pair_is_taken_however_little_of_it_both_see_and_whether_or_not_it_moves(
    harm: Callable[[Gray, Gray], Pair], standing: bool
) -> None:
    pixels = followed(drive(harm, standing)).pixels
    disparity = pixels[:, 0] - pixels[:, 2]
    assert len(pixels) >= 3 * FRAMES
    assert np.median(disparity) == pytest.approx(DISPARITY_PX, abs=0.2) or harm is fence


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (swapped, "in the same row but further right, .* are left and right swapped, or is the"),
        (turned, "in other rows .*are they rectified, is the calibration theirs"),
        (lower, r"in other rows \(\+11 rows lower in the median\), 0 in the same"),
        (another, "in the same row, no more than by chance; pictures of a rectified pair that"),
        (covered, "shows 0 in the same row, no more than by chance; .*is one camera covered"),
    ],
)
@pytest.mark.parametrize("standing", [False, True])
def test_what_is_no_rectified_pair_is_refused_by_what_it_shows(
    harm: Callable[[Gray, Gray], Pair], said: str, standing: bool
) -> None:
    with pytest.raises(PelorusError, match=said):
        followed(drive(harm, standing))
