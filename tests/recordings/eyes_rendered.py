# SPDX-License-Identifier: MIT
"""Eyes (src/vision) on the rendered drive of docs/images/hero.py, where the truth is exact.

usage: eyes_rendered.py [--draws 4] [--first 3] [--only TEXT] [--alone] [--opencv]
                        [--points 100] [--shutter-ms 20]

Its pictures are rendered once into build/hero and build/hero-rolling-20, some ten minutes in all.
Each draw has its own noise of the odometry, which also tells the eyes what to expect, and how the
camera moves at the time of a pair: the mean of the twists that end and begin there.

as it is     the pictures of README
exposure     every second 20 pairs are 1.5 times as bright
moving       a board over 20 % of the picture goes to and fro, 4 m ahead
rolling      a shutter of 20 ms (--shutter-ms), told as row_time_s; a frame's time is that of its
             middle row

RMS         of the position, cm: median and worst of the draws
NEES/3      mean; 1 is expected
drift       of u and v of a track after ten pairs, px, 1.48 times the median of its size
lasts       pairs a track
thirds      squared errors of uL, vL and uR by those that sights tell, by thirds of the told sigma,
            without the share that is said: errors beyond four sigma, mostly of edges before
            something farther away, where the truth of a point is not one
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.tracker import Seen, Tracker
from pelorus.wire.layout import Floats
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "docs/images"), str(ROOT / "tests/python")]

import hero  # type: ignore[import-not-found]  # noqa: E402 - its folder is no package
import street  # type: ignore[import-not-found]  # noqa: E402
from opencv_tracker.settings import Settings  # noqa: E402
from opencv_tracker.tracker import track  # noqa: E402

Gray = NDArray[np.uint8]
Pair = tuple[Gray, Gray]
DRIFT_PAIRS = 10
GATE = 16.3  # of the squares of three errors: four sigma


def as_it_is(_: int, pair: Pair) -> Pair:
    """Returns the pictures unchanged."""
    return pair


def exposed(k: int, pair: Pair) -> Pair:
    """Returns the pictures with a longer exposure by times."""
    by = 1.5 if k // 20 % 2 else 1.0
    left, right = (np.clip(np.round(by * one), 0, 255).astype(np.uint8) for one in pair)
    return left, right


def board() -> NDArray[np.float32]:
    """Returns the texture of the thing that moves: a fifth of the picture."""
    rng = np.random.default_rng(11)
    shape = round(street.HEIGHT * np.sqrt(0.2)), round(street.WIDTH * np.sqrt(0.2))
    soft = [street.noise(rng, (512, 512), scale)[: shape[0], : shape[1]] for scale in (4, 12)]
    return np.asarray(np.clip(120 + 30 * soft[0] + 20 * soft[1], 0, 255), np.float32)


def moving() -> Callable[[int, Pair], Pair]:
    """Returns what puts the board before the pictures."""
    texture = board()
    disparity = street.FOCAL * street.BASELINE_M / 4.0

    def with_board(k: int, pair: Pair) -> Pair:
        rng, out = np.random.default_rng([5, k]), []
        for side, picture in enumerate(pair):
            u = 130 + 110 * np.sin(2 * np.pi * k / 60) - side * disparity
            to = np.array([[1, 0, u], [0, 1, 60 + 10 * np.sin(k / 5)]], np.float32)
            size = street.WIDTH, street.HEIGHT
            drawn = cv2.warpAffine(texture, to, size) + rng.normal(0, 1, picture.shape)
            covers = cv2.warpAffine(np.ones_like(texture), to, size) > 0.999
            out.append(np.where(covers, np.clip(np.round(drawn), 0, 255), picture))
        return out[0].astype(np.uint8), out[1].astype(np.uint8)

    return with_board


def motions(seed: int) -> Iterator[Poses | None]:
    """Yields by how much the points of the camera move up to each pair, as odometry tells."""
    T_CB = Poses(hero.R_CB, np.zeros(3))
    for k, steps in enumerate(hero.twists(seed)):
        R, p, dt = np.eye(3), np.zeros(3), 1 / hero.RATE_HZ / hero.TWISTS_PER_FRAME
        for _, v, w in steps:
            p = p + R @ Rotation.from_rotvec(w * dt / 2).as_matrix() @ v * dt
            R = R @ Rotation.from_rotvec(w * dt).as_matrix()
        yield se3.conjugate(T_CB, se3.inverse(Poses(R, p))) if k else None


def velocities(seed: int) -> Iterator[tuple[Floats, Floats] | None]:
    """Yields v and w of the camera at each pair: the mean of the twists beside it."""
    steps = hero.twists(seed)
    for before, after in pairwise([*steps, []]):
        beside = [*before[-1:], *after[:1]]
        v, w = (np.mean([one[i] for one in beside], axis=0) for i in (1, 2))
        yield hero.R_CB @ v, hero.R_CB @ w


def seen_by(pairs: list[Pair], seed: int, points: int, shutter_s: float) -> list[Seen]:
    """Returns the result of each pair."""
    size, row_s = (street.WIDTH, street.HEIGHT), shutter_s / street.HEIGHT
    tracker = Tracker.rectified(hero.camera(), *size, tracks=points, row_time_s=row_s)
    moved = zip(pairs, motions(seed), velocities(seed), strict=True)
    return [
        tracker.track(10**9 + k * 10**9 // hero.RATE_HZ, *pair, motion=motion, velocity=velocity)
        for k, (pair, motion, velocity) in enumerate(moved)
    ]


def tracks_of(seen: list[Seen]) -> Tracks:
    """Returns all observations."""
    return Tracks.of_frames([one.observations["id"] for one in seen], [one.pixels for one in seen])


def surface(R: Floats, p: Floats, u: Floats, v: Floats) -> Floats:
    """Returns the points that pixels show: of the boxes and the ground."""
    camera, boxes = hero.camera(), street.block()
    ray = np.stack(((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px))
    rays = np.stack((*ray, np.ones_like(u)), axis=-1) @ R.T
    low, high = (np.array([getattr(box, end) for box in boxes]) - p for end in ("low", "high"))
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = low[None] / rays[:, None], high[None] / rays[:, None]
        ground = np.where(rays[:, 2] < 0, -p[2] / rays[:, 2], np.inf)
    enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    t = np.where((enter < leave) & (enter > 0.05), enter, np.inf).min(axis=-1)
    t = np.minimum(t, ground)
    return np.asarray(p + np.where(np.isfinite(t), t, 1e6)[:, None] * rays)


def errors(seen: list[Seen]) -> tuple[Floats, Floats, Floats]:
    """Returns age, told sigma, and the errors of uL, vL, uR beside the surface seen at birth."""
    born: dict[int, Floats] = {}
    ages, sigmas, off = [], [], []
    camera = hero.camera()
    for k, one in enumerate(seen):
        ids, pixels = one.observations["id"], one.pixels.astype(float)
        R, p = hero.eyes_of(k / hero.RATE_HZ, 0, 0)
        fresh = [i for i, id in enumerate(ids) if id not in born]
        points = surface(R, p, pixels[fresh, 0], pixels[fresh, 1])
        born.update(zip(ids[fresh].tolist(), points, strict=True))
        X = (np.array([born[id] for id in ids.tolist()]).reshape(-1, 3) - p) @ R
        u = camera.fx_px * X[:, 0] / X[:, 2] + camera.cx_px
        v = camera.fy_px * X[:, 1] / X[:, 2] + camera.cy_px
        right = u - camera.fx_px * camera.baseline_m / X[:, 2]
        off.append(pixels[:, :3] - np.stack((u, v, right), axis=-1))
        ages.append(one.sights["age"].astype(float))
        sigmas.append(one.sights["sigma_px"].astype(float))
    return np.concatenate(ages), np.concatenate(sigmas), np.concatenate(off)


def of_sights(seen: list[Seen]) -> str:
    """Returns drift, length, and how far the told sigmas hold."""
    age, sigma, off = errors(seen)
    after = abs(off[age == DRIFT_PAIRS])
    drift = 1.4826 * np.median(after[:, :2], axis=0)
    d2 = (off**2).sum(axis=1) / sigma**2
    followed = age > 0
    held = followed & (d2 < GATE)
    edges = np.quantile(sigma[held], (1 / 3, 2 / 3))
    third = np.digitize(sigma[held], edges)
    thirds = [d2[held][third == i].mean() / 3 for i in range(3)]
    lasts = len(age) / len(np.unique(np.concatenate([one.observations["id"] for one in seen])))
    return (
        f"{drift[0]:8.3f}{drift[1]:6.3f}{lasts:7.1f}   "
        + " ".join(f"{third:.2f}" for third in thirds)
        + f", without {1 - held.sum() / followed.sum():.3f}"
    )


def of_drives(drives: list[hero.Run]) -> str:
    """Returns the error's RMS and NEES."""
    rms, nees = [], []
    for run in drives:
        e = run.p - run.truth
        rms.append(100 * np.sqrt((e**2).sum(axis=1).mean()))
        d2 = np.einsum("ki,ki->k", e[1:], np.linalg.solve(run.P[1:], e[1:, :, None])[..., 0])
        nees.append(d2.mean() / 3)
    return f"{np.median(rms):7.2f}{max(rms):7.2f}{np.median(nees):8.2f}"


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--first", type=int, default=3, help="seed of the first draw")
    parser.add_argument("--shutter-ms", type=int, default=20, help="of the rolling shutter")
    parser.add_argument("--points", type=int, default=100)
    parser.add_argument("--only", default="", help="variants whose names have this text")
    parser.add_argument("--alone", action="store_true", help="as pelorus track has them, too")
    parser.add_argument("--opencv", action="store_true", help="its tracks of the pictures, too")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"{'':12}{'RMS':>7}{'worst':>7}{'NEES/3':>8}{'drift':>10}{'lasts':>11}   thirds")
    for name, change, shutter_s in (
        ("as it is", as_it_is, 0.0), ("exposure", exposed, 0.0), ("moving", moving(), 0.0),
        ("rolling", as_it_is, given.shutter_ms * 1e-3),
    ):  # fmt: skip
        if given.only not in name:
            continue
        rolling = hero.KEPT.with_name(f"hero-rolling-{given.shutter_ms}")
        kept = rolling if shutter_s else hero.KEPT
        colour = hero.rendered(kept, shutter_s)
        pairs = [
            change(k, (hero.gray(left), hero.gray(right))) for k, (left, right) in enumerate(colour)
        ]
        seeds = range(given.first, given.first + given.draws)
        seen = [seen_by(pairs, seed, given.points, shutter_s) for seed in seeds]
        drives = [hero.drive(tracks_of(one), k) for one, k in zip(seen, seeds, strict=True)]
        sights = of_sights(seen[0]) if name == "as it is" else ""
        print(f"{name:12}{of_drives(drives)}{sights}", flush=True)
        if given.alone:
            alone = hero.followed(pairs)
            drives = [hero.drive(alone, seed) for seed in seeds]
            print(f"{'  alone':12}{of_drives(drives)}", flush=True)
        if given.opencv:
            tracks = track(pairs, (kept, kept), Settings())
            drives = [hero.drive(tracks, seed) for seed in seeds]
            print(f"{'  OpenCV':12}{of_drives(drives)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
