# SPDX-License-Identifier: MIT
"""Eyes (src/vision) on real pictures, beside OpenCV's tracker in the same chain.

usage: eyes.py [--bin build/bin] [--starts 10] [--convert] [--opencv]

EuRoC MH_01's first ten seconds of $PELORUS_DATA (by default ../shared/data), whole and halved
once and twice; the gyro alone predicts, with its bias in it; settings of
tools/config/imu-adis16448.conf. Several starts, each a tenth of a second later: medians. An absent
recording is left out.

--convert: also the tracks of `pelorus convert`, whose motion is expected to go on as the pictures
showed it; --opencv: also those of OpenCV's tracker (tests/python/opencv_tracker).

err0, ATE   mm, as `pelorus evaluate` has them
NEES/6      mean; 1 is expected
worst       the largest err0 of the starts
tracks      observations a pair, and the mean length of a track in pairs
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import judge
import numpy as np
from numpy.typing import NDArray
from pelorus.converters import euroc, streams
from pelorus.converters.streams import Asked, Pictures, Readings, Streams
from pelorus.io import trajectory
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math.inertial import Inertial
from pelorus.math.motion import Times
from pelorus.rig.lens import Lens
from pelorus.tracker import Tracker
from pelorus.wire.frames import Camera, Header
from pelorus.wire.layout import Floats
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(judge.ROOT / "tests/python"))

from opencv_tracker import tracker
from opencv_tracker.settings import Settings

FOLDER = "images/euroc-mh01-start"
SIZES = ((1, 60), (2, 50), (4, 50))  # halved so often, points
FRAMES_APART = 2  # of two starts: a tenth of a second
Gray = NDArray[np.uint8]


def shrunk(lens: Lens, times: int) -> Lens:
    """Returns the lens of pictures in which squares of `times` pixels a side became one."""
    fx, fy, cx, cy = lens.intrinsics
    four = (fx / times, fy / times, (cx + 0.5) / times - 0.5, (cy + 0.5) / times - 0.5)
    size = lens.width_px // times, lens.height_px // times
    return replace(lens, intrinsics=four).sized(*size)


def small(picture: Gray, times: int) -> Gray:
    """Returns the means of squares of `times` pixels a side."""
    rows, columns = (side // times for side in picture.shape)
    squares = picture[: rows * times, : columns * times].reshape(rows, times, columns, times)
    return np.ascontiguousarray(np.round(squares.mean((1, 3))).astype(np.uint8))


def turns(t_ns: Times, readings: Inertial, R_CB: Floats) -> list[Floats]:
    """Returns the points' rotation in the camera from pair to pair, by the gyro."""
    found = []
    for begin, end in pairwise(t_ns.tolist()):
        between = (readings.t_ns >= begin) & (readings.t_ns < end)
        theta = readings.w_B_radps[between].mean(axis=0) * (end - begin) * 1e-9
        found.append(R_CB @ Rotation.from_rotvec(theta).as_matrix().T @ R_CB.T)
    return found


def followed(found: Streams, times: int, points: int) -> tuple[Recording, float]:
    """Returns the recording with the tracks of eyes, and their mean length."""
    assert found.calibrated.rig is not None
    assert isinstance(found.frames, Pictures)
    assert isinstance(found.motion, Readings)
    rig = found.calibrated.rig
    rig = replace(rig, left=shrunk(rig.left, times), right=shrunk(rig.right, times))
    assert rig.T_LB is not None
    own = Tracker(rig, tracks=points)
    camera = own.calibration(rig.T_LB.R, rig.T_LB.p)
    t_ns = rig.on_body_clock(found.frames.t_ns)
    R = np.asarray(camera.R_CB)
    motion = [None, *((turn, np.zeros(3)) for turn in turns(t_ns, found.motion.inertial, R))]
    seen = [
        own.track(int(t), small(left, times), small(right, times), motion=moved)
        for t, (left, right), moved in zip(t_ns, found.frames.read(), motion, strict=True)
    ]
    tracks = Tracks.of_frames(
        [one.observations["id"] for one in seen],
        [one.pixels for one in seen],
        [one.observations["sigma_px"] for one in seen],
    )
    five = (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px, camera.baseline_m)
    header = replace(
        found.calibrated.header, camera=Camera(*five), R_CB=R, t_CB_m=np.asarray(camera.t_CB_m),
        image_width_px=rig.left.width_px, image_height_px=rig.left.height_px,
    )  # fmt: skip
    return with_tracks(found, header, tracks), mean_length(tracks)


def with_tracks(found: Streams, header: Header, tracks: Tracks) -> Recording:
    """Returns the recording with these tracks in the place of pictures."""
    rig = found.calibrated.rig
    assert rig is not None
    assert found.truth is not None
    t_ns = rig.on_body_clock(found.frames.t_ns)
    of_tracks = replace(found, frames=streams.RawTracks(Path(), t_ns, tracks))
    made = streams.with_motion(header, of_tracks, t_ns, tracks)
    truth = streams.at_frames(found.truth, t_ns, found.motion)
    return made.with_truth(truth.t_ns, truth.poses)


def by_opencv(found: Streams) -> Recording:
    """Returns the recording with the tracks of OpenCV's tracker."""
    rig = found.calibrated.rig
    assert rig is not None
    assert isinstance(found.frames, Pictures)
    rectification = rig.rectification()
    pairs = (rectification.pictures(*pair) for pair in found.frames.read())
    tracks = tracker.track(pairs, found.frames.where, Settings())
    return with_tracks(found, rig.header(rectification, "OpenCV"), tracks)


def mean_length(tracks: Tracks) -> float:
    """Returns the pairs a track was seen in."""
    lengths = np.bincount(tracks.id)
    return float(lengths[lengths > 0].mean())


def later(drive: Recording, first: int) -> Recording:
    """Returns the recording from a frame on."""
    begin = drive.frame_t_ns[first]
    rows, own, true = drive.tracks.frame >= first, drive.inertial, drive.truth_t_ns >= begin
    kept = own.t_ns >= begin - 10_000_000
    tracks, count = drive.tracks.at(rows), drive.tracks.frame_count - first
    tracks = replace(tracks, frame_count=count, frame=tracks.frame - first)
    return replace(
        drive, frame_t_ns=drive.frame_t_ns[first:], tracks=tracks,
        inertial=Inertial(own.t_ns[kept], own.a_B_mps2[kept], own.w_B_radps[kept]),
        truth_t_ns=drive.truth_t_ns[true], truth=drive.truth.at(true),
    )  # fmt: skip


def tell(name: str, drive: Recording, starts: int, program: Path, length: float) -> None:
    """Prints a row of the table."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(starts):
            plr = Path(folder) / "drive.plr"
            later(drive, k * FRAMES_APART).write(plr)
            found = judge.figures(judge.run(program, plr, judge.conf("imu-adis16448")))
            rows.append([1e3 * found["err0"], 1e3 * found["ATE"], found["NEES/6"]])
    err0, ate, nees = np.median(rows, axis=0)
    a_pair = len(drive.tracks) / drive.tracks.frame_count
    worst = max(row[0] for row in rows)
    print(
        f"{name:22}{err0:7.1f}{ate:7.1f}{nees:8.2f}{worst:8.1f}{a_pair:8.0f} x {length:.1f}",
        flush=True,
    )


def main() -> int:
    """Prints the table."""
    parser = judge.parser_of(__doc__, "unused")
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--convert", action="store_true", help="the tracks of convert, too")
    parser.add_argument("--opencv", action="store_true", help="its tracker, too")
    given = parser.parse_args()
    folder = judge.DATA / FOLDER
    if not folder.is_dir():
        print(f"{folder}: is not here, and left out")
        return 0
    found = euroc.read(folder, Asked(truth=trajectory.read_truth(folder / "truth.tum")))
    program = given.bin / "pelorus-replay"
    print(f"{'':22}{'err0':>7}{'ATE':>7}{'NEES/6':>8}{'worst':>8}{'tracks':>10}")
    for times, points in SIZES:
        name = f"{752 // times} x {480 // times}, {points} points"
        drive, length = followed(found, times, points)
        tell(name, drive, given.starts, program, length)
    if given.convert:
        drive = streams.recording(found)
        tell("752 x 480, convert", drive, given.starts, program, mean_length(drive.tracks))
    if given.opencv:
        drive = by_opencv(found)
        tell("752 x 480, OpenCV", drive, given.starts, program, mean_length(drive.tracks))
    return 0


if __name__ == "__main__":
    sys.exit(main())
