# SPDX-License-Identifier: MIT
"""Wheels beside an IMU: where they sit, what they measure, where they stand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bags import Recorder
from converted import Run, messages_of
from draws import draws
from pelorus.converters import wheels
from pelorus.converters.wheels import Rolling
from pelorus.io.recording import Recording
from pelorus.io.small_sensors import STANDSTILL, WHEEL
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.readings import Sensing
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Header, Pose, Process, Reading, Twist
from pelorus.wire.layout import Floats, unpack_symmetric
from replay_drive import judged, run
from scipy.spatial.transform import Rotation
from test_convert_csv import csv_files, write_csv

SECOND = 1_000_000_000
SLIDE_MPS = 0.2
SEAT = Poses(Rotation.from_euler("zyx", [90.0, 0.0, 0.0], degrees=True).as_matrix(), np.zeros(3))
TRACK_M = 0.5


def rolling(v_mps: Floats, letters: str = "x", sigma: float = 0.05) -> Rolling:
    t_ns = np.arange(len(v_mps)) * SECOND // 10
    return Rolling(t_ns, v_mps, np.full_like(v_mps, sigma), letters)


def test_wheels_that_sit_turned_measure_along_the_axis_that_is_nearest() -> None:
    T_BW = Poses(Rotation.from_euler("z", 30, degrees=True).as_matrix(), np.array([0.1, 0.0, -0.2]))
    at_W = np.array([0.0, 0.25, 0.0])
    found = wheels.readings(rolling(np.array([[2.0, 9.0, 9.0]])), T_BW, at_W, SLIDE_MPS)
    assert [reading.axes for reading in found] == [1]
    assert found[0].value == pytest.approx([2 * np.cos(np.pi / 6), 0, 0])
    across = SLIDE_MPS * np.sin(np.pi / 6)  # what they may slide, seen from the body
    assert found[0].sigma[0] == pytest.approx(np.hypot(0.05 * np.cos(np.pi / 6), across))
    assert found[0].at_B_m == pytest.approx([0.1 - 0.125, 0.25 * np.cos(np.pi / 6), -0.2])


def test_wheels_that_steer_measure_two_axes_of_a_body_on_its_side() -> None:
    T_BW = Poses(Rotation.from_euler("y", 90, degrees=True).as_matrix(), np.zeros(3))
    found = wheels.readings(rolling(np.array([[2.0, 1.0, 9.0]]), "xy"), T_BW, np.zeros(3), 0.2)
    assert found[0].axes == WHEEL.axes("yz")
    assert found[0].value == pytest.approx([0, 1, -2])
    assert found[0].sigma == pytest.approx([0, 0.05, 0.05])


def test_a_body_that_cannot_slide_is_measured_along_all_axes() -> None:
    v_mps, nowhere = np.array([[2.0, 9.0, 9.0]]), np.zeros(3)
    found = wheels.readings(rolling(v_mps), SEAT, nowhere, 0.1, held=True)
    assert found[0].axes == 7
    assert found[0].value == pytest.approx([0, 2, 0])
    assert found[0].sigma == pytest.approx([0.1, 0.05, 0.1])


DARK = Span(10.0, 60.0)


@pytest.mark.parametrize("seed", draws([1, 2]))
def test_a_minute_in_the_dark_costs_a_percent_of_the_way_if_the_body_cannot_slide(
    seed: int, tmp_path: Path
) -> None:
    """At 1 m/s, with readings of 0 across the wheels; the IMU alone is tens of metres off."""
    wheel = Sensing(rate_hz=50.0, axes="xyz", sigma=(0.03, 0.05, 0.05))
    imu = SimulatedImu(imu_rate_hz=200.0, rest_s=2.0)
    options = Options(seed=seed, duration_s=70.0, speed_mps=1.0, imu=imu, readings={"wheel": wheel})
    drive = simulate(options).recording
    t_s = (drive.frame_t_ns - drive.frame_t_ns[0]) / SECOND
    lit = (t_s < DARK.from_s)[drive.tracks.frame]
    columns = (drive.tracks.frame[lit], drive.tracks.id[lit], drive.tracks.pixels[lit])
    path, log = tmp_path / "dark.plr", tmp_path / "log.plr"
    replace(drive, tracks=Tracks(drive.tracks.frame_count, *columns)).write(path)
    run(path, "--out", log, "--quiet")
    last = [m for m in messages_of(log, Pose) if m.after_stereo][-1]
    truth = drive.truth.p[np.searchsorted(drive.truth_t_ns, last.t_ns)]
    off = last.R_WB.T @ (truth - last.p_WB_m)
    P = unpack_symmetric(last.covariance[None], 6)[0, :3, :3]
    assert np.linalg.norm(off) < 0.01 * DARK.for_s
    assert off @ np.linalg.solve(P, off) / 3 < 4


def test_the_body_stands_while_all_wheels_read_zero() -> None:
    v = np.zeros((60, 3))
    v[:10, 0] = 1.0
    left, right = (wheels.readings(rolling(v), Poses(np.eye(3), p), p, 0.2) for p in np.eye(3)[:2])
    said: list[str] = []
    found = wheels.standing([*left, *right], said)
    assert [m.t_ns / SECOND for m in found] == pytest.approx(np.arange(1.5, 5.45, 0.1))
    assert all(m.sensor == STANDSTILL.number and m.axes == 3 for m in found)
    assert said == ["the wheels stand: 40 readings of a standstill, one each 0.1 s"]
    right[30] = replace(right[30], value=np.array([0.1, 0, 0]))
    assert len(wheels.standing([*left, *right], [])) == 30
    assert wheels.standing(left[:18], said) == []
    assert len(said) == 1


# --- of a bag -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drive() -> Recording:
    """Twenty seconds with an IMU, some of which the body stands."""
    options = Options(
        duration_s=20.0, imu=SimulatedImu(imu_rate_hz=200.0, rest_s=1.5), stop=Span(8.0, 5.0)
    )
    return simulate(options).recording


@pytest.fixture(scope="module")
def given(drive: Recording, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """A bag of tracks, IMU and wheels' odometry, whose frame is turned against the IMU's; the
    options that convert it."""
    folder, recorder = tmp_path_factory.mktemp("wheels"), Recorder()
    bounds, tracks = drive.tracks.bounds(), drive.tracks
    for k, t in enumerate(drive.frame_t_ns.tolist()):
        own = slice(bounds[k], bounds[k + 1])
        names = ("uL", "vL", "uR", "vR")
        pixels = dict(zip(names, tracks.pixels[own].T, strict=True))
        recorder.cloud("/tracks", t, {"id": tracks.id[own], **pixels}, "cam")
    readings = drive.inertial
    for t, a, w in zip(readings.t_ns.tolist(), readings.a_B_mps2, readings.w_B_radps, strict=True):
        recorder.imu("/imu", t, a, w, "imu")
    assert drive.truth_velocity is not None
    turn = np.diff(drive.truth_t_ns)[:, None] * 1e-9
    rates = se3.log(se3.compose(se3.inverse(drive.truth.at(slice(None, -1))),
                                drive.truth.at(slice(1, None))))[:, 3:] / turn  # fmt: skip
    for t, v, w in zip(drive.truth_t_ns.tolist(), drive.truth_velocity, rates, strict=False):
        v_W, w_W = SEAT.R.T @ v, SEAT.R.T @ w
        recorder.odometry("/odom", t, v_W, w_W, Poses(np.eye(3), np.zeros(3)), "wheels")
        recorder.joints("/joints", t, {"left": 10 * (v_W[0] - w_W[2] * TRACK_M / 2),
                                       "right": 10 * (v_W[0] + w_W[2] * TRACK_M / 2)})  # fmt: skip
    recorder.transforms("/tf_static", 0, {("imu", "wheels"): SEAT})
    csv_files(folder, drive)  # for its camera.json
    bag = recorder.write(folder / "drive")
    words = ("--calibration", folder / "camera.json", "--tracks-topic", "/tracks")
    return ["convert", "ros", bag, *words, "--fix", "none"]


def test_a_bags_wheels_go_beside_its_imu_along_their_own_axes(
    given: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    words = [*given, tmp_path / "out.plr"]
    outcome = pelorus(*words, "--wheel-topic", "/odom", status=1)
    assert "/odom: messages tell no covariance; --wheel-sigma M/S is expected" in outcome.err
    said = pelorus(*words, "--wheel-topic", "/odom", "--wheel-sigma", 0.05).out
    assert "/odom: the wheels sit as /tf_static says" in " ".join(said.split())
    assert "the wheels stand: " in said
    target = tmp_path / "out.plr"
    assert messages_of(target, Header)[0].process is Process.IMU
    assert not messages_of(target, Twist)
    found = messages_of(target, Reading)
    rolled = [m for m in found if m.sensor == WHEEL.number]
    assert {m.axes for m in rolled} == {WHEEL.axes("y")}  # the wheels' x is the IMU's y
    stood = [m.t_ns / SECOND for m in found if m.sensor == STANDSTILL.number]
    assert len(stood) == 47, "0.6 s of the first rest, 4.1 of the second"
    assert 0.4 < stood[0] < stood[5] < 1.5
    assert all(8.4 < t < 12.6 for t in stood[6:])
    told = judged(target)
    assert told["messages_refused"] == told["readings_refused"] < 30, "until the IMU has started"
    assert told["readings_gated"] < 0.05 * told["readings_used"]


def test_two_wheels_of_a_bag_measure_the_turn_by_where_they_sit(
    given: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    words = [*given, tmp_path / "out.plr"]
    target = tmp_path / "out.plr"
    track: tuple[Any, ...] = ("--track-width", TRACK_M, "--no-wheel-standstill")
    track += ("--wheel-sigma", 0.05, "--wheel-slide", 0.1)
    pelorus(*words, "--wheel-topic", "/odom", *track)
    of_odometry = messages_of(target, Reading)
    assert {tuple(m.at_B_m.round(9)) for m in of_odometry} == {(-0.25, 0, 0), (0.25, 0, 0)}
    joints = ("--joint-topic", "/joints", "--joint", "left", "--joint", "right")
    pelorus(*words, *joints, "--wheel-radius", 0.1, *track, "--imu-topic", "/imu", "--force")
    of_joints = messages_of(target, Reading)
    assert {m.axes for m in (*of_odometry, *of_joints)} == {7}
    assert len(of_joints) == len(of_odometry)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--wheel-topic", "/odom", "--twist-topic", "/odom"), "wheels go beside an IMU: leave"),
        (("--wheel-topic", "/odom", "--wheel-axes", "w"), "--wheel-axes is w: some of the letters"),
        (("--wheel-topic", "/odom", "--wheel-sigma", -1), "--wheel-sigma is -1: more than 0"),
        (("--wheel-topic", "/imu"), "/imu holds"),
        (
            ("--wheel-topic", "/odom", "--twists", "v.csv", "--measured", "vx"),
            "--twists moves the body, and --wheel-topic goes beside an IMU",
        ),
        (("--wheel-topic", "/wheels"), "has no topic /wheels"),
    ],
)
def test_wheels_that_make_no_sense_are_refused_by_option(
    words: tuple[Any, ...], said: str, given: list[Any], tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "out.plr"
    speed = {"t_s": [0.0, 30.0], "vx_mps": [1.0, 1.0]}
    words = tuple(
        write_csv(tmp_path / "v.csv", speed) if word == "v.csv" else word for word in words
    )
    assert said in pelorus(*given, target, *words, status=1).err
    assert not target.exists()


def test_wheels_of_a_table_that_stand_are_a_standstill(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    assert drive.truth_velocity is not None
    readings = drive.inertial
    names = ("ax", "ay", "az", "wx", "wy", "wz")
    numbers = np.hstack((readings.a_B_mps2, readings.w_B_radps)).T.tolist()
    imu = {"t_ns": readings.t_ns.tolist(), **dict(zip(names, numbers, strict=True))}
    speed = drive.truth_velocity[:, 0].round(3)
    wheel = {"t_ns": drive.truth_t_ns, "vx_mps": speed, "sigma_mps": [0.05] * len(speed)}
    words: list[Any] = ["convert", "csv", *csv_files(tmp_path, drive)[2:], tmp_path / "out.plr"]
    words += ["--imu", write_csv(tmp_path / "imu.csv", imu)]
    words += ["--wheel", write_csv(tmp_path / "wheel.csv", wheel)]
    assert "the wheels stand: " in pelorus(*words).out
    sensors = [m.sensor for m in messages_of(tmp_path / "out.plr", Reading)]
    assert sensors.count(STANDSTILL.number) > 30
    rest = write_csv(tmp_path / "rest.csv", {"t_s": [9.0], "sigma_mps": [0.01]})
    pelorus(*words, "--standstill", rest, "--force")
    sensors = [m.sensor for m in messages_of(tmp_path / "out.plr", Reading)]
    assert sensors.count(STANDSTILL.number) == 1
