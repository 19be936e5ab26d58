# SPDX-License-Identifier: MIT
"""The figures against cases whose answer is known in closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run, messages_of
from drives import clean
from pelorus.evaluate import evaluation, road
from pelorus.evaluate.evaluation import Accuracy, assess
from pelorus.io.trajectory import Trajectory, read_stamped, read_truth
from pelorus.math import se3
from pelorus.math.consistency import rms
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Header, Truth
from pelorus.wire.layout import Floats
from replay_drive import BIN
from scipy.spatial.transform import Rotation

COUNT = 200
CHANCE = np.random.default_rng(9)
TIMES = 1_700_000_000_123_456_789 + np.arange(COUNT, dtype=np.int64) * 100_000_000


def straight(metres_a_pose: float = 1.0) -> Poses:
    p = np.zeros((COUNT, 3))
    p[:, 0] = metres_a_pose * np.arange(COUNT)
    return Poses(np.tile(np.eye(3), (COUNT, 1, 1)), p)


def winding() -> Poses:
    """A path that leaves its plane, turning all the way."""
    k = np.arange(COUNT)
    p = np.stack((30 * np.sin(k / 20), 20 * np.cos(k / 33), 0.1 * k), axis=-1)
    return Poses(
        Rotation.from_rotvec(np.stack((0.01 * k, 0.003 * k, 0.02 * k), axis=-1)).as_matrix(), p
    )


def moved(T: Poses, by: Poses) -> Poses:
    return se3.compose(Poses(np.tile(by.R, (len(T.p), 1, 1)), np.tile(by.p, (len(T.p), 1))), T)


def save(path: Path, poses: Poses, t_ns: Any = TIMES) -> Path:
    """As pelorus-replay --trajectory writes it, with nine decimals."""
    q = Rotation.from_matrix(poses.R).as_quat()
    rows = zip(np.asarray(t_ns).tolist(), np.hstack((poses.p, q)).tolist(), strict=True)
    lines = [
        f"{t // 10**9}.{t % 10**9:09d} " + " ".join(f"{x:.9f}" for x in row) for t, row in rows
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def evaluate(pelorus: Run, *arguments: Any) -> dict[str, float]:
    outcome = pelorus("evaluate", *arguments, "--json")
    found: dict[str, float] = json.loads(outcome.out)
    return found


def figures(estimate: Poses, truth: Poses) -> Accuracy:
    """Pose k of one against pose k of the other."""
    found = assess(Trajectory(TIMES, estimate), Trajectory(TIMES, truth))
    assert found is not None
    return found


def test_the_same_path_in_another_world_has_no_error() -> None:
    by = se3.exp(np.array([100.0, -20, 5]), np.array([0.3, -1.2, 2.0]))
    found = figures(moved(winding(), by), winding())
    assert found.err0_m < 1e-10
    assert found.ate_m < 1e-10
    assert found.rot_deg < 1e-5
    assert len(found.t_ns) == COUNT


def test_a_constant_turn_of_the_estimate_is_an_error_of_its_angle() -> None:
    """Behind the first pose all rotations are off by a, all positions right."""
    a = np.radians(3.0)
    truth = winding()
    R = truth.R @ Rotation.from_rotvec(np.array([0, 0, a])).as_matrix()
    R[0] = truth.R[0]
    found = figures(Poses(R, truth.p), truth)
    assert found.rot_deg == pytest.approx(3.0 * np.sqrt((COUNT - 1) / COUNT))
    assert found.err0_m < 1e-10


def test_a_first_heading_that_is_off_swings_the_path_and_the_fit_takes_it_back() -> None:
    """The first pose is turned by a: aligned there, pose k of a line is 2 k sin(a/2) away."""
    a = np.radians(10.0)
    truth = straight()
    R = truth.R.copy()
    R[0] = Rotation.from_rotvec(np.array([0, 0, a])).as_matrix()
    found = figures(Poses(R, truth.p), truth)
    k = np.arange(COUNT)
    assert found.err0_m == pytest.approx(2 * np.sin(a / 2) * np.sqrt(np.mean(k**2)))
    assert found.rot_deg == pytest.approx(10.0 * np.sqrt((COUNT - 1) / COUNT))
    assert found.ate_m < 1e-9


def test_a_scale_is_not_fitted() -> None:
    """A line 1 % too long: err0 grows from the start, ate from the middle."""
    truth, estimate = straight(), straight(1.01)
    found = figures(estimate, truth)
    k = np.arange(COUNT)
    assert found.err0_m == pytest.approx(0.01 * np.sqrt(np.mean(k**2)))
    assert found.ate_m == pytest.approx(0.01 * np.std(k))
    assert evaluation.path_m(estimate) == pytest.approx(1.01 * (COUNT - 1))


def test_a_way_of_another_scale_is_fitted_with_it() -> None:
    chance = np.random.default_rng(8)
    source = chance.normal(size=(50, 3))
    A = se3.exp([3.0, -2.0, 1.0], [0.3, -1.0, 2.0])
    fit, scale = evaluation.similarity_fit(source, 1.7 * source @ A.R.T + A.p)
    assert scale == pytest.approx(1.7)
    assert np.allclose(fit.R, A.R)
    assert np.allclose(fit.p, A.p)


def test_the_rigid_fit_is_the_least_squares_one_and_never_a_mirror() -> None:
    source = CHANCE.normal(size=(50, 3)) * [10, 5, 0.01]
    by = se3.exp(np.array([1.0, 2, 3]), np.array([0.5, 1.0, -0.7]))
    target = source @ by.R.T + by.p + CHANCE.normal(0, 0.1, (50, 3))
    fit = evaluation.rigid_fit(source, target)
    assert np.linalg.det(fit.R) == pytest.approx(1.0)
    best = rms(se3.apply(fit, source) - target)
    for _ in range(200):
        step = se3.exp(CHANCE.normal(0, 0.01, 3), CHANCE.normal(0, 0.01, 3))
        assert rms(se3.apply(se3.compose(step, fit), source) - target) >= best
    mirrored = source * [1, 1, -1]
    assert np.linalg.det(evaluation.rigid_fit(source, mirrored).R) == pytest.approx(1.0)


def test_poses_are_matched_by_time_each_once(tmp_path: Path, pelorus: Run) -> None:
    truth = save(tmp_path / "truth.tum", winding())
    every_third = save(tmp_path / "third.tum", winding().at(slice(1, None, 3)), TIMES[1::3])
    found = evaluate(pelorus, every_third, "--truth", truth)
    assert found["truth_frames"] == len(TIMES[1::3])
    assert found["err0_m"] < 1e-6
    late = save(tmp_path / "late.tum", winding(), TIMES + 5_000)
    outcome = pelorus("evaluate", late, "--truth", truth, status=1)
    assert "late.tum: 0 of its 200 poses" in outcome.err
    assert "truth.tum" in outcome.err
    assert evaluate(pelorus, late, "--truth", truth, "--tolerance", 1e-5)["truth_frames"] == COUNT


def test_times_survive_a_tum_file_to_the_nanosecond(tmp_path: Path) -> None:
    path = save(tmp_path / "x.tum", winding())
    read = read_stamped(path)
    assert np.array_equal(read.t_ns, TIMES)
    assert np.allclose(read.poses.R, winding().R, atol=1e-8)
    assert np.allclose(read.poses.p, winding().p, atol=1e-8)


def test_truth_comes_from_a_recording_at_the_times_of_its_frames(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "drive.plr"
    pelorus("simulate", target, "--duration", 10, "--drop", 0.3)
    truth = messages_of(target, Truth)
    t_ns = [m.t_ns for m in truth]
    poses = Poses(np.array([m.R_WB for m in truth]), np.array([m.p_WB_m for m in truth]))
    estimate = save(tmp_path / "x.tum", poses, t_ns)
    found = evaluate(pelorus, estimate, "--truth", target)
    assert found["truth_frames"] < len(truth), "frames that were dropped are not evaluated"
    assert found["err0_m"] < 1e-7
    outcome = pelorus("evaluate", estimate, "--truth", target)
    assert "RMS position error after the best rigid fit" in outcome.out


def test_kitti_poses_are_brought_to_the_body_of_the_recording(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "drive.plr"
    clean(duration_s=10.0).write(target)
    header = messages_of(target, Header)[0]
    truth = messages_of(target, Truth)
    body = Poses(np.array([m.R_WB for m in truth]), np.array([m.p_WB_m for m in truth]))
    T_WC = se3.compose(body, se3.inverse(Poses(header.R_CB, header.t_CB_m)))
    C = se3.compose(se3.inverse(T_WC.at(0)), T_WC)
    kitti = tmp_path / "kitti.txt"
    rows = np.concatenate((C.R, C.p[:, :, None]), axis=2).reshape(-1, 12)
    np.savetxt(kitti, rows)
    times = [m.t_ns for m in truth]
    estimate = save(tmp_path / "x.tum", body, times)
    assert evaluate(pelorus, estimate, "--truth", kitti, "--recording", target)["err0_m"] < 1e-6
    cameras = save(tmp_path / "c.tum", C, times)
    stamps = tmp_path / "times.txt"
    stamps.write_text("".join(f"{t / 1e9:.9f}\n" for t in times))
    assert evaluate(pelorus, cameras, "--truth", kitti, "--times", stamps)["err0_m"] < 1e-6
    outcome = pelorus("evaluate", estimate, "--truth", kitti, status=1)
    assert "give --recording or --times" in outcome.err
    stamps.write_text("1.0\n2.0\n")
    outcome = pelorus("evaluate", cameras, "--truth", kitti, "--times", stamps, status=1)
    assert "101 poses, but" in outcome.err


@pytest.mark.parametrize("waits", [0, 7])
def test_a_filter_that_was_told_no_pose_is_compared_from_its_start_on(waits: int) -> None:
    """Until its IMU shows the vertical it stands at identity; the truth's heading is another."""
    tilt = Rotation.from_rotvec([0.3, -1.9, 0.1]).as_matrix()
    body = moved(winding(), Poses(tilt, np.zeros(3)))  # the world's vertical is known, by the tilt
    R, p = body.R.copy(), body.p - body.p[waits]
    R[:waits], p[:waits] = np.eye(3), 0.0
    P = np.tile(np.eye(6) * 1e-6, (COUNT, 1, 1))
    P[:waits] = np.eye(6) * 1e-8
    P[waits:, 5, 4] = P[waits:, 4, 5] = P[waits:, 0, 3] = P[waits:, 3, 0] = 1e-7
    standing = body.p.copy()
    standing[:waits] = body.p[waits]
    by = Poses(Rotation.from_rotvec([0, 0, 2.2]).as_matrix(), np.array([40.0, -3, 8]))
    truth = Trajectory(TIMES, moved(Poses(body.R, standing), by))
    found = assess(Trajectory(TIMES, Poses(R, p)), truth, P, upright=True)
    assert found is not None
    assert found.rot_deg < 1e-5
    assert found.err0_m < 1e-9
    assert len(found.t_ns) == COUNT - waits


# --- the road -------------------------------------------------------------------------------------


def town() -> Floats:
    """A road without symmetry, a point every metre."""
    corners = np.array([[0, 0], [200, 0], [200, 90], [120, 90], [120, 160], [-40, 160]], float)
    return road.densified(corners)


def save_road(path: Path, points: Floats) -> Path:
    rows = [
        f"{arc:.2f},{x:.3f},{y:.3f}"
        for arc, (x, y) in zip(road.arc_length(points), points, strict=True)
    ]
    path.write_text("# arc_m,x_m,y_m\n" + "\n".join(rows) + "\n")
    return path


def test_a_trajectory_on_the_road_is_found_there_wherever_it_lies(
    tmp_path: Path, pelorus: Run
) -> None:
    flat = np.concatenate((town(), np.zeros((len(town()), 1))), axis=1)
    tilt = Rotation.from_rotvec(np.radians([7.0, 0, 0])).as_matrix()
    by = Poses(
        tilt @ Rotation.from_rotvec(np.array([0, 0, 2.0])).as_matrix(), np.array([500.0, -300, 40])
    )
    poses = Poses(np.tile(np.eye(3), (len(flat), 1, 1)), se3.apply(by, flat))
    estimate = save(tmp_path / "x.tum", poses, np.arange(1, len(flat) + 1) * 10**8)
    found = evaluate(pelorus, estimate, "--road", save_road(tmp_path / "road.csv", town()))
    assert found["road_m"] < 0.05
    assert found["out_of_plane_m"] < 1e-6
    assert found["tilt_deg"] == pytest.approx(7.0, abs=1e-3)


def test_noise_beside_the_road_and_out_of_the_plane_is_measured() -> None:
    points = road.densified(np.array([[0, 0], [400, 0], [400, 200], [150, 200]], float))
    wobble = 2.0 * np.sign(np.sin(np.arange(len(points)) / 5.0))  # two metres to either side
    along = np.gradient(points, axis=0)
    normal = np.stack((-along[:, 1], along[:, 0]), axis=-1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    height = 0.5 * np.sin(np.arange(len(points)) / 3.0)
    position = np.concatenate((points + wobble[:, None] * normal, height[:, None]), axis=1)
    found = road.compare(position, points, 10.0)
    assert found.road_m == pytest.approx(2.0, rel=0.05)
    assert found.out_of_plane_m == pytest.approx(0.5 / np.sqrt(2), rel=0.02)


def test_the_first_metres_are_left_out() -> None:
    """The road on the map begins 60 m later than the trajectory."""
    points = town()
    lead = np.stack((np.zeros(60), np.linspace(-60, -1, 60)), axis=-1)
    flat = np.concatenate((lead, points))
    whole = np.concatenate((flat, np.zeros((len(flat), 1))), axis=1)
    assert road.compare(whole, points, 60.0).road_m < 0.05
    assert road.compare(whole, points, 0.0).road_m > 2.0


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "the file is empty"),
        ("# only a comment\n", "holds no row of numbers"),
        ("1 2 3\n", "line 1: has 3 numbers; 8 are expected"),
        ("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "line 2: time does not ascend"),
        ("0 0 0 0 0 0 0 1\n1 0 0 x 0 0 0 1\n", "line 2: holds something that is no number"),
        ("0 0 0 nan 0 0 0 1\n", "line 1: holds a number that is not finite"),
        ("0 0 0 0 0 0 0 0\n", "line 1: the quaternion's norm is not 1"),
        ("now 0 0 0 0 0 0 1\n", "line 1: holds something that is no number"),
        ("1e300 0 0 0 0 0 0 1\n", "out of range"),
        ("1e999999999 0 0 0 0 0 0 1\n", "line 1: holds a number that is not finite (1 of 1"),
        ("1e99999 0 0 0 0 0 0 1\n", "line 1: holds a number that is not finite (1 of 1"),
        ("nan 0 0 0 0 0 0 1\n", "line 1: holds a number that is not finite (1 of 1"),
    ],
)
def test_a_trajectory_that_is_none_is_refused_by_line(
    tmp_path: Path, pelorus: Run, content: str, said: str
) -> None:
    path = tmp_path / "bad.tum"
    path.write_text(content)
    good = save(tmp_path / "good.tum", winding())
    outcome = pelorus("evaluate", path, "--truth", good, status=1)
    assert "bad.tum" in outcome.err
    assert said in outcome.err


def test_other_mistakes_are_told(tmp_path: Path, pelorus: Run) -> None:
    good = save(tmp_path / "good.tum", winding())
    pelorus("evaluate", good, status=2)
    pelorus("evaluate", good, "--truth", good, "--road", good, status=2)
    assert "no such file" in pelorus("evaluate", good, "--truth", tmp_path / "x", status=1).err
    assert "cannot be read" in pelorus("evaluate", tmp_path / "x", "--truth", good, status=1).err
    binary = tmp_path / "binary.tum"
    binary.write_bytes(b"\xff\xfe\x80")
    assert "is no text" in pelorus("evaluate", binary, "--truth", good, status=1).err
    five = tmp_path / "five.txt"
    five.write_text("1 2 3 4 5\n")
    assert "rows of 5 numbers" in pelorus("evaluate", good, "--truth", five, status=1).err
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    pelorus("evaluate", good, "--road", empty, status=1)
    short = save(tmp_path / "short.tum", straight(0.001))
    drawn = save_road(tmp_path / "road.csv", town())
    assert "too short" in pelorus("evaluate", short, "--road", drawn, status=1).err


def test_a_recording_without_truth_is_no_reference(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=2.0)
    bare = drive.with_truth(drive.truth_t_ns[:0], drive.truth.at(slice(0, 0)))
    bare.write(tmp_path / "bare.plr")
    good = save(tmp_path / "good.tum", winding())
    outcome = pelorus("evaluate", good, "--truth", tmp_path / "bare.plr", status=1)
    assert "holds no TRUTH" in outcome.err
    drive.with_truth(drive.truth_t_ns + 1, drive.truth).write(tmp_path / "off.plr")
    outcome = pelorus("evaluate", good, "--truth", tmp_path / "off.plr", status=1)
    assert "0 of its 200 poses" in outcome.err
    drive.write(tmp_path / "good.plr")
    assert len(read_truth(tmp_path / "good.plr").t_ns) == 21


def test_a_step_that_changes_is_told_in_the_body_s_own_axes() -> None:
    """A circle at an even pace is as calm as a straight way; a shake is what it is."""
    turns = np.stack((np.zeros(50), np.zeros(50), 0.1 * np.arange(50)), axis=-1)
    sine, cosine = np.sin(turns[:, 2]), np.cos(turns[:, 2])
    way = 10 * np.stack((sine, -cosine, np.zeros(50)), axis=-1)
    circle = Poses(Rotation.from_rotvec(turns).as_matrix(), way)
    assert evaluation.step_change(circle) == pytest.approx(0, abs=1e-12)
    shaken = Poses(np.tile(np.eye(3), (50, 1, 1)), np.zeros((50, 3)))
    shaken.p[::2, 0] = 0.5
    assert evaluation.step_change(shaken) == pytest.approx(1.0)


def test_truth_is_found_between_the_frames_where_the_camera_has_another_clock(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "late.plr"
    pelorus("simulate", target, "--duration", 12, "--seed", 4)
    plain = pelorus("evaluate", target, "--bin", BIN, "--json", status=None)
    options = ("--set", "camera-offset=-0.012", "--set", "twist-delay=0.05")
    moved = pelorus("evaluate", target, "--bin", BIN, "--json", *options, status=None)
    assert plain.status == moved.status == 0, moved.err
    frames = json.loads(plain.out)["truth_frames"]
    assert json.loads(moved.out)["truth_frames"] >= frames - 2  # the first lies before all truth
