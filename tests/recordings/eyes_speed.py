# SPDX-License-Identifier: MIT
"""Time of a pair for eyes (src/vision) beside OpenCV's corners and Lucas-Kanade, one thread each.

usage: eyes_speed.py [--rounds 20] [--pairs 20] [--points 100]

The first pairs of EuRoC MH_01, 752 x 480; the gyro tells eyes what to expect. OpenCV's calls go to
its C++: corners of each left picture, Lucas-Kanade from the last left picture to this one, and from
left to right, with the window, levels and quality of the tests' tracker by OpenCV; nothing is
checked back.
Both run in turn, in rounds; of each pair the least time of this thread counts, ms, mean over the
pairs behind the first, which gives birth to all tracks.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import cv2
import judge
import numpy as np
from pelorus.converters import euroc
from pelorus.converters.streams import Asked, Pictures, Readings
from pelorus.tracker import Tracker
from pelorus.wire.layout import Floats

import eyes

sys.path.insert(0, str(judge.ROOT / "tests/python"))
from opencv_tracker.matching import LEVELS, QUALITY
from opencv_tracker.settings import Settings

Pair = tuple[eyes.Gray, eyes.Gray]
SETTINGS = Settings()
WINDOW = SETTINGS.window_px, SETTINGS.window_px


def own(tracker: Tracker, t_ns: list[int], pairs: list[Pair], turns: list[Floats]) -> list[float]:
    """Returns the time of each pair."""
    tracker.forget()
    motion = [None, *((turn, np.zeros(3)) for turn in turns)]
    found = []
    for t, pair, moved in zip(t_ns, pairs, motion, strict=True):
        begin = time.thread_time_ns()
        tracker.track(t, *pair, motion=moved)
        found.append((time.thread_time_ns() - begin) * 1e-6)
    return found


def opencv(pairs: list[Pair], points: int) -> tuple[list[float], list[float]]:
    """Returns the times of the corners and of both passes."""
    corners, passes = [], []
    last = pairs[0][0]
    for left, right in pairs:
        begin = time.thread_time_ns()
        found: Any = cv2.goodFeaturesToTrack(left, points, QUALITY, SETTINGS.spacing_px)
        middle = time.thread_time_ns()
        for one, other in ((last, left), (left, right)):
            nowhere: Any = None
            cv2.calcOpticalFlowPyrLK(one, other, found, nowhere, winSize=WINDOW, maxLevel=LEVELS)
        corners.append((middle - begin) * 1e-6)
        passes.append((time.thread_time_ns() - middle) * 1e-6)
        last = left
    return corners, passes


def main() -> int:
    """Prints the times."""
    parser = judge.parser_of(__doc__, "unused")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--points", type=int, default=100)
    given = parser.parse_args()
    folder = judge.DATA / eyes.FOLDER
    if not folder.is_dir():
        print(f"{folder}: is not here, and left out")
        return 0
    cv2.setNumThreads(1)
    found = euroc.read(folder, Asked())
    rig = found.calibrated.rig
    assert rig is not None
    assert rig.T_LB is not None
    assert isinstance(found.frames, Pictures)
    assert isinstance(found.motion, Readings)
    pairs = [pair for pair, _ in zip(found.frames.read(), range(given.pairs), strict=False)]
    t_ns = rig.on_body_clock(found.frames.t_ns)[: given.pairs]
    tracker = Tracker(rig, tracks=given.points)
    R = np.asarray(tracker.calibration(rig.T_LB.R, rig.T_LB.p).R_CB)
    turns = eyes.turns(t_ns, found.motion.inertial, R)
    rows = []
    for _ in range(given.rounds):
        rows.append((own(tracker, t_ns.tolist(), pairs, turns), *opencv(pairs, given.points)))
    mine, corners, passes = np.array(rows).min(axis=0)[:, 1:].mean(axis=1)
    theirs = corners + passes
    print(f"eyes {mine:.2f} ms, OpenCV {corners:.2f} + {passes:.2f} = {theirs:.2f} ms", end="")
    print(f": {mine / theirs:.2f} times")
    return 0


if __name__ == "__main__":
    sys.exit(main())
