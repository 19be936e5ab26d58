#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws docs/images/eyes.webp: tracks of `pelorus.Tracker` in two pictures of hero.py's drive.

usage: PYTHONPATH=tools eyes.py [FILE.webp]
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import hero
import numpy as np
import street
from pelorus import Tracker
from pelorus.io.tracks import Tracks

FRAMES, SHOWN, POINTS = 40, (12, 39), 100


def main() -> None:
    """Follows, draws, writes."""
    tracker = Tracker.rectified(hero.camera(), street.WIDTH, street.HEIGHT, tracks=POINTS)
    pairs = hero.rendered()[:FRAMES]
    bodies = [hero.body(k / hero.RATE_HZ) for k in range(FRAMES)]
    seen = []
    for k, (left, right) in enumerate(pairs):
        (R0, p0), (R1, p1) = bodies[max(k - 1, 0)], bodies[k]
        motion = hero.R_CB @ R1.T @ R0 @ hero.R_CB.T, hero.R_CB @ R1.T @ (p0 - p1)
        seen.append(tracker.track(1 + k * 10**8, hero.gray(left), hero.gray(right), motion=motion))
    tracks = Tracks.of_frames([s.observations["id"] for s in seen], [s.pixels for s in seen])
    tiles = [hero.with_tracks(pairs[k][0], tracks, k) for k in SHOWN]
    target = sys.argv[1] if len(sys.argv) > 1 else str(Path(__file__).with_suffix(".webp"))
    picture = cv2.cvtColor(np.hstack(tiles), cv2.COLOR_RGB2BGR)
    cv2.imwrite(target, picture, [cv2.IMWRITE_WEBP_QUALITY, 80])


if __name__ == "__main__":
    main()
