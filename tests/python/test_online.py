# SPDX-License-Identifier: MIT
"""The filter on a robot: the order of what comes, pairs, and a log that replays to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pelorus.commands.cli import main
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.online.drive import Setup
from pelorus.online.odometry import Given, Odom, Odometry
from pelorus.online.order import ClockStep, Datum, Joining, Pairing, Sequencer
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Config, Imu, Pose, Start, Stereo, Twist
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats

MS = 1_000_000
pytestmark = pytest.mark.usefixtures("built")


@pytest.fixture(scope="module")
def recording() -> Recording:
    """With an IMU, which stands for two seconds and then drives."""
    imu = SimulatedImu(imu_rate_hz=200.0)
    return simulate(Options(seed=4, duration_s=8.0, imu=imu)).recording


def data_of(recording: Recording) -> list[Datum]:
    """One reading a message, as an IMU's topic has them."""
    data: list[Datum] = []
    for m in recording.messages():
        if isinstance(m, Imu):
            rows = zip(m.times_ns, m.a_B_mps2, m.w_B_radps, strict=True)
            data += [Imu(t, a[None], w[None]) for t, a, w in rows]
        elif isinstance(m, Stereo | Twist):
            data.append(m)
    return data


def odometry(recording: Recording, log: Path | None = None, given: Given | None = None) -> Odometry:
    return Odometry(Setup(recording.header, recording.settings), log=log, given=given)


def driven(robot: Odometry, data: list[Datum]) -> list[Odom]:
    told = [odom for datum in data for odom in robot.add(datum)]
    return told + robot.finish()


def frame(t_ms: int) -> Stereo:
    return Stereo(t_ms * MS, np.zeros(0, np.uint32), np.zeros((0, 4), np.float32))


def reading(t_ms: int) -> Imu:
    return Imu(t_ms * MS, np.array([[0, 0, 9.81]]), np.zeros((1, 3)))


def times(due: list[Datum | ClockStep]) -> list[tuple[str, int]]:
    return [(type(d).__name__, d.t_ns // MS) for d in due if not isinstance(d, ClockStep)]


# --- the log --------------------------------------------------------------------------------------


def test_log_of_a_drive_replays_to_the_bit(recording: Recording, tmp_path: Path) -> None:
    log = tmp_path / "drive.plr"
    told = driven(odometry(recording, log), data_of(recording))
    assert len(told) > 20
    assert told[-1].estimate.health == 0
    assert main(["compare", str(log)]) == 0
    poses = [m for m in messages_of(log) if isinstance(m, Pose)]
    assert np.array_equal(poses[-1].p_WB_m, told[-1].estimate.T_WB.p)


def test_late_reordered_and_lost_messages_leave_a_log_that_replays(
    recording: Recording, tmp_path: Path
) -> None:
    chance, log = np.random.default_rng(1), tmp_path / "drive.plr.zst"
    data = [d for d in data_of(recording) if chance.random() > 0.02]
    late = [d.t_ns + chance.exponential(15 * MS) for d in data]
    robot = odometry(recording, log)
    told = driven(robot, [data[k] for k in np.argsort(late)])
    assert robot.sequencer.counts.late > 0
    assert told[-1].estimate.health < 2
    stamps = [one.t_ns for one in told]
    assert stamps == sorted(stamps)
    assert main(["compare", str(log)]) == 0


def test_a_clock_that_steps_begins_a_new_drive_where_the_last_one_was(
    recording: Recording, tmp_path: Path
) -> None:
    log = tmp_path / "drive.plr"
    robot = odometry(recording, log)
    data = data_of(recording)
    before = [odom for d in data for odom in robot.add(d)]
    later = [shifted(d, -3600) if d.t_ns > 3600 * 10**9 else shifted(d, 3600) for d in data]
    after = driven(robot, later)
    assert robot.drives == 2
    assert "the stamps jumped" in robot.remarks[0]
    assert robot.sequencer.counts.steps == 1
    start = next(m for m in messages_of(tmp_path / "drive-2.plr") if isinstance(m, Start))
    assert np.array_equal(start.p_WB_m, before[-1].estimate.T_WB.p)
    assert after[0].covariance[0, 0] > 100 * before[-1].covariance[0, 0]
    for name in ("drive.plr", "drive-2.plr"):
        assert main(["compare", str(tmp_path / name)]) == 0


def shifted(datum: Datum, seconds: int) -> Datum:
    t_ns = datum.t_ns + seconds * 10**9
    if isinstance(datum, Imu):
        return Imu(t_ns, datum.a_B_mps2, datum.w_B_radps)
    assert isinstance(datum, Stereo)
    return Stereo(t_ns, datum.ids, datum.pixels)


def test_a_camera_that_dies_leaves_poses_whose_covariance_grows(recording: Recording) -> None:
    data = data_of(recording)
    dies = data[0].t_ns + 5 * 10**9
    told = driven(odometry(recording), [d for d in data if isinstance(d, Imu) or d.t_ns < dies])
    sigma = [(odom.t_ns, float(np.sqrt(odom.covariance[0, 0]))) for odom in told]
    blind = [s for t, s in sigma if t > dies]
    seeing = [s for t, s in sigma if t <= dies]
    assert len(blind) > 10
    assert blind[-1] > 5 * seeing[-1]
    assert told[-1].estimate.health == 2


def test_a_full_disk_ends_the_log_and_not_the_drive(recording: Recording) -> None:
    robot = odometry(recording, Path("/dev/full"))
    told = [odom for d in data_of(recording) for odom in robot.add(d)]
    assert len(told) > 20
    assert robot.drive is not None
    assert robot.drive.log is not None
    assert "the log /dev/full ends here: No space left" in robot.drive.log.trouble


def test_a_saved_state_goes_on_where_it_was(recording: Recording) -> None:
    data = data_of(recording)
    half = len(data) * 3 // 4
    first, second = odometry(recording), odometry(recording)
    whole = [odom for d in data[:half] for odom in first.add(d)]
    saved = first.save()
    second.load(saved)
    rest = [odom for d in data[half:] for odom in first.add(d)]
    other = [odom for d in data[half:] for odom in second.add(d)]
    assert len(whole) > 10
    assert abs(rest[-1].T_OB.p - other[-1].T_OB.p).max() < 0.05
    assert other[0].T_OB.p == pytest.approx(rest[0].T_OB.p, abs=0.05)


def test_a_pose_that_is_given_is_where_odom_begins_and_lies_in_the_log(
    recording: Recording, tmp_path: Path
) -> None:
    T = Poses(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([10.0, 20.0, 0.5]))
    log = tmp_path / "drive.plr"
    robot = odometry(recording, log, Given(T, 1e-4 * np.eye(6)))
    told = driven(robot, data_of(recording))
    assert np.linalg.norm(told[0].T_OB.p - T.p) < 0.5
    assert main(["compare", str(log)]) == 0


def test_a_pose_that_is_given_on_the_way_replays_to_the_bit(
    recording: Recording, tmp_path: Path
) -> None:
    data, log = data_of(recording), tmp_path / "drive.plr"
    robot = odometry(recording, log)
    half = len(data) * 3 // 4
    for d in data[:half]:
        robot.add(d)
    there = Poses(np.eye(3), np.array([5.0, 0.0, 0.0]))
    robot.place(Given(there, 1e-4 * np.eye(6)))
    told = driven(robot, data[half:])
    assert np.linalg.norm(told[0].T_OB.p - there.p) < 1.0
    assert main(["compare", str(log)]) == 0


def test_log_has_the_settings_that_were_asked_for(recording: Recording, tmp_path: Path) -> None:
    log = tmp_path / "drive.plr"
    robot = Odometry(Setup(recording.header, {"slots": 40.0}), log=log)
    driven(robot, data_of(recording)[:100])
    wanted, in_force = (m for m in messages_of(log) if isinstance(m, Config))
    assert list(wanted.settings.values()) == [40.0]
    assert in_force.settings[4] == 40.0


# --- the order ------------------------------------------------------------------------------------


def test_a_frame_waits_for_the_reading_behind_it() -> None:
    sequencer = Sequencer(500 * MS, 2000 * MS)
    assert times(sequencer.add(reading(10))) == []
    assert times(sequencer.add(frame(12))) == [("Imu", 10)]
    assert times(sequencer.add(reading(15))) == [("Stereo", 12)]
    assert times(sequencer.add(frame(20))) == [("Imu", 15)]


def test_a_camera_that_is_dead_stops_no_reading_for_long() -> None:
    sequencer = Sequencer(100 * MS, 2000 * MS)
    released = [t for k in range(100) for t in times(sequencer.add(reading(5 * k)))]
    assert released[-1] == ("Imu", 395)


def test_a_camera_with_another_clock_is_left_out_and_is_no_step() -> None:
    sequencer = Sequencer(100 * MS, 2000 * MS)
    for k in range(50):
        sequencer.add(reading(5 * k))
        sequencer.add(frame(10**7 + 5 * k))
    assert sequencer.counts.steps == 0
    assert sequencer.counts.off_clock == 50
    assert sequencer.off_by_ns == pytest.approx(10**7 * MS, rel=0.01)


def test_one_wrong_stamp_is_no_step() -> None:
    sequencer = Sequencer(100 * MS, 2000 * MS)
    for k in range(50):
        sequencer.add(reading(10**6 if k == 25 else 5 * k))
    assert sequencer.counts.steps == 0
    assert sequencer.counts.off_clock == 1


# --- pairs ----------------------------------------------------------------------------------------


def test_pictures_are_paired_in_any_order_of_arrival() -> None:
    pairing: Pairing[str] = Pairing(2 * MS)
    assert pairing.add(True, 100 * MS, "r") is None
    assert pairing.add(True, 150 * MS, "s") is None
    assert pairing.add(False, 101 * MS, "l") == (101 * MS, "l", "r")
    assert pairing.add(False, 150 * MS, "m") == (150 * MS, "m", "s")
    assert pairing.alone == 0


def test_cameras_21_ms_apart_make_no_pair_and_the_gap_is_told() -> None:
    pairing: Pairing[int] = Pairing(2 * MS)
    for k in range(20):
        assert pairing.add(False, 50 * k * MS, k) is None
        assert pairing.add(True, (50 * k + 21) * MS, k) is None
    assert pairing.alone > 20
    assert pairing.usual_gap_ms == pytest.approx(21)


def test_gyro_and_accelerometer_apart_are_joined_at_the_gyros_times() -> None:
    joining, made = Joining(), []

    def force(t_ns: int) -> Floats:
        return np.array([t_ns * 1e-9, 0.0, 9.81])

    for k in range(10):
        made += joining.force(4 * k * MS, force(4 * k * MS))
        made += joining.rate((4 * k + 1) * MS, np.array([0.0, 0.0, k]))
    assert [m.t_ns for m in made] == [(4 * k + 1) * MS for k in range(9)]
    assert np.allclose([m.a_B_mps2[0, 0] for m in made], [m.t_ns * 1e-9 for m in made])


def test_pose_of_the_base_is_that_of_the_body_moved_along(recording: Recording) -> None:
    T_IB = Poses(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.5, 0.0, 0.1]))
    setup = Setup(recording.header, recording.settings)
    data = data_of(recording)
    of_base = driven(Odometry(setup, T_IB), data)[-1]
    body = of_base.estimate
    velocity = T_IB.R.T @ (body.velocity[:3] + np.cross(body.velocity[3:], T_IB.p))
    np.testing.assert_allclose(of_base.velocity[:3], velocity, atol=1e-12)
    assert se3.compose(body.T_WB, T_IB).p != pytest.approx(body.T_WB.p, abs=1e-3)
