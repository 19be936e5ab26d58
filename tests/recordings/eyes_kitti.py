# SPDX-License-Identifier: MIT
"""Eyes (src/vision) on the first 51 pairs of KITTI 06 with noisy twists, beside OpenCV's tracker.

usage: eyes_kitti.py [--bin build/bin] [--draws 20] [--points 120]

Each draw has its own noise of the twists, 0.5 m/s and 0.05 rad/s, as tests/python/test_track.py has
them; it also tells the eyes what to expect. "alone": the tracks of `pelorus track`, whose motion is
expected to go on as the pictures showed it. Settings of tools/config/track.conf.

err0        m, as `pelorus evaluate` has it: median, mean and worst of the draws
NEES/6      median; 1 is expected
thirds      NIS by dof of the first draw, its observations with the sigmas that sights tell, the
            tracks by thirds of those, each third alone in the filter
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import judge
import numpy as np
from pelorus.io import trajectory
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.tracker import Tracker
from pelorus.tracking import images
from pelorus.wire.frames import Camera, Report, TwistTiming
from pelorus_course import matlab
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(judge.ROOT / "tests/python"))

from followed_pairs import followed_in
from opencv_tracker.settings import Settings
from opencv_tracker.tracker import track

FOLDER = "images/kitti-06-start"
DRIVE = "klt/2011_09_30_drive_0020_sync_KLT.mat"
V_SIGMA, W_SIGMA = 0.5, 0.05  # m/s, rad/s


def drives(folder: Path, count: int) -> Iterator[Recording]:
    """Yields the drive with noise in its twists, and without tracks."""
    source = matlab.klt(judge.DATA / DRIVE, TwistTiming.END)
    cameras = trajectory.read_kitti(folder / "poses.txt")
    bodies = se3.compose(se3.compose(se3.inverse(source.T_CB), cameras), source.T_CB)
    there = slice(0, len(images.pairs(folder / "image_l", folder / "image_r")))
    bodies = bodies.at(there)
    t_ns, v, w = source.frame_t_ns[there], source.v_B_mps[there], source.w_B_radps[there]
    P = np.loadtxt(folder / "calib.txt").reshape(2, 3, 4)
    fx, fy, cx, cy = P[0, 0, 0], P[0, 1, 1], P[0, 0, 2], P[0, 1, 2]
    header = source.with_header(camera=Camera(fx, fy, cx, cy, -P[1, 0, 3] / fx)).header
    none = Tracks.none(len(t_ns))
    for seed in range(count):
        noise = np.random.default_rng(seed)
        noisy = v + noise.normal(0, V_SIGMA, v.shape), w + noise.normal(0, W_SIGMA, w.shape)
        yield Recording(header, t_ns, *noisy, t_ns, none, t_ns, bodies)


def motions(drive: Recording, T_CB: Poses) -> Iterator[Poses | None]:
    """Yields by how much the points move up to each pair: a twist ends at its time."""
    yield None
    steps = np.diff(drive.frame_t_ns) * 1e-9
    for dt, v, w in zip(steps, drive.v_B_mps[1:], drive.w_B_radps[1:], strict=True):
        R = Rotation.from_rotvec(w * dt).as_matrix()
        p = Rotation.from_rotvec(w * dt / 2).as_matrix() @ v * dt
        yield se3.conjugate(T_CB, se3.inverse(Poses(R, p)))


def followed(drive: Recording, pairs: list[tuple[images.Gray, images.Gray]], points: int) -> Tracks:
    """Returns the tracks of eyes."""
    camera = drive.header.camera
    height, width = pairs[0][0].shape
    tracker = Tracker.rectified(camera, width, height, tracks=points)
    seen = [
        tracker.track(int(t), *pair, motion=motion)
        for t, pair, motion in zip(drive.frame_t_ns, pairs, motions(drive, drive.T_CB), strict=True)
    ]
    return Tracks.of_frames(
        [one.observations["id"] for one in seen],
        [one.pixels for one in seen],
        [one.sights["sigma_px"] for one in seen],
    )


def run(program: Path, drive: Recording) -> tuple[judge.Figures, float]:
    """Returns the figures of a replay, and NIS by its dof."""
    with tempfile.TemporaryDirectory() as folder:
        plr = Path(folder) / "drive.plr"
        drive.write(plr)
        messages = judge.run(program, plr, judge.conf("track"))
    reports = [m for m in messages if isinstance(m, Report) and m.nis_dof > 0]
    nis = sum(m.nis for m in reports) / max(sum(m.nis_dof for m in reports), 1)
    return judge.figures(messages), nis


def thirds(program: Path, drive: Recording) -> str:
    """Returns NIS by dof of the thirds of the tracks, by the sigmas that sights tell."""
    own = drive.tracks
    assert own.sigma_px is not None
    sums = np.bincount(own.id, own.sigma_px) / np.maximum(np.bincount(own.id), 1)
    of_track = sums[own.id]
    third = np.digitize(of_track, np.quantile(of_track, (1 / 3, 2 / 3)))
    parts = [replace(drive, tracks=own.at(third == i)) for i in range(3)]
    return " ".join(f"{run(program, part)[1]:.2f}" for part in parts)


def main() -> int:
    """Prints the table."""
    parser = judge.parser_of(__doc__, "unused")
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--points", type=int, default=120)
    given = parser.parse_args()
    folder, program = judge.DATA / FOLDER, given.bin / "pelorus-replay"
    if not folder.is_dir() or not (judge.DATA / DRIVE).is_file():
        print(f"{folder}: is not here, and left out")
        return 0
    sides = folder / "image_l", folder / "image_r"
    pairs = [images.read(pair) for pair in images.pairs(*sides)]
    judged = track(pairs, sides, Settings(corners=given.points))
    alone = followed_in(pairs, given.points, sides)
    rows: dict[str, list[list[float]]] = {"eyes": [], "alone": [], "OpenCV": []}
    told = ""
    for drive in drives(folder, given.draws):
        own = replace(drive, tracks=followed(drive, pairs, given.points))
        told = told or thirds(program, own)
        plain = replace(own, tracks=replace(own.tracks, sigma_px=None))
        others = (replace(drive, tracks=tracks) for tracks in (alone, judged))
        for name, one in zip(rows, (plain, *others), strict=True):
            found = run(program, one)[0]
            rows[name].append([found["err0"], found["NEES/6"]])
    print(f"{'':8}{'err0':>7}{'mean':>7}{'worst':>7}{'NEES/6':>8}")
    for name, found_all in rows.items():
        err0, nees = np.array(found_all).T
        print(
            f"{name:8}{np.median(err0):7.3f}{err0.mean():7.3f}{err0.max():7.3f}{np.median(nees):8.2f}"
        )
    print(f"NIS by thirds of the told sigma: {told}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
