# SPDX-License-Identifier: MIT
"""ODOMETRY for an autopilot: frames, covariance, and what is expected beside it; ports that go."""

from __future__ import annotations

import os
import pty
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pelorus.errors import PelorusError
from pelorus.live import port
from pelorus.live.autopilot import COMPONENT, Autopilot, Origin, fields
from pelorus.live.port import Port, Udp
from pelorus.math import se3
from pelorus.math.se3 import IDENTITY, Poses
from pelorus.online.drive import UNKNOWN_COVARIANCE, Estimate
from pelorus.online.odometry import Odom
from pelorus.wire.layout import Floats
from scipy.spatial.transform import Rotation

common = pytest.importorskip("pymavlink.dialects.v20.common", reason="pymavlink is not installed")

S = 1_000_000_000
M = np.diag([1.0, -1.0, -1.0])
SAMPLES = 20_000


def odom(
    euler_deg: tuple[float, float, float] = (40.0, -20.0, 10.0),
    covariance: Floats | None = None,
    health: int = 0,
    t_ns: int = 5 * S,
) -> Odom:
    """Returns one at yaw, pitch, roll in axes forward, left, up."""
    R = Rotation.from_euler("ZYX", euler_deg, degrees=True).as_matrix()
    A = np.random.default_rng(2).standard_normal((6, 6)) * 1e-2
    P = A @ A.T if covariance is None else covariance
    estimate = Estimate(t_ns, IDENTITY, P, np.zeros(6), P, health, 0)
    velocity = np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    return Odom(t_ns, Poses(R, np.array([3.0, 2.0, 1.0])), P, velocity, P, estimate, 300)


def symmetric(upper: Any) -> Floats:
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = upper
    return full + np.triu(full, 1).T


def euler_of(R: Floats) -> Floats:
    """Returns roll, pitch, yaw (..., 3) as an autopilot has them."""
    return np.asarray(Rotation.from_matrix(R).as_euler("ZYX")[..., ::-1])


# --- the message ----------------------------------------------------------------------------------


def test_axes_are_turned_from_forward_left_up_to_forward_right_down() -> None:
    at = odom()
    f = fields(at)
    assert f.p.tolist() == [3.0, -2.0, -1.0]
    assert f.v.tolist() == [1.0, -2.0, -3.0]
    assert f.w.tolist() == [0.1, -0.2, -0.3]
    w, x, y, z = f.q_wxyz
    R = Rotation.from_quat([x, y, z, w]).as_matrix()
    np.testing.assert_allclose(R, M @ at.T_OB.R @ M, atol=1e-12)
    yaw, pitch, roll = Rotation.from_matrix(R).as_euler("ZYX", degrees=True)
    assert (yaw, pitch, roll) == pytest.approx((-40.0, 20.0, 10.0))  # left is less, up is more
    assert f.time_usec == 5_000_000
    assert f.reset_counter == 300 - 256


def test_covariance_is_that_of_position_and_euler_angles_by_sampling() -> None:
    """T = T^ Exp(xi), xi of the covariance: how x, y, z, roll, pitch and yaw scatter."""
    at = odom()
    xi = np.random.default_rng(3).multivariate_normal(np.zeros(6), at.covariance, SAMPLES)
    T = se3.compose(at.T_OB, se3.exp(xi[:, :3], xi[:, 3:]))
    R = M @ T.R @ M
    off = np.hstack((T.p @ M - M @ at.T_OB.p, euler_of(R) - euler_of(M @ at.T_OB.R @ M)))
    expected = symmetric(fields(at).pose_covariance)
    whitened = np.linalg.solve(np.linalg.cholesky(expected), off.T)
    np.testing.assert_allclose(np.cov(whitened), np.eye(6), atol=0.05)


def test_velocity_covariance_bears_the_signs_of_both_axes() -> None:
    at = odom()
    both = np.kron(np.eye(2), M)
    found = symmetric(fields(at).velocity_covariance)
    np.testing.assert_allclose(found, both @ at.velocity_covariance @ both)


def test_what_is_not_known_is_nan_and_quality_follows_health() -> None:
    assert np.isnan(fields(odom(covariance=UNKNOWN_COVARIANCE)).pose_covariance).all()
    assert np.isnan(fields(odom((0.0, 89.0, 0.0))).pose_covariance[0])
    assert [fields(odom(health=k)).quality for k in range(4)] == [100, 50, 1, -1]


# --- beside it ------------------------------------------------------------------------------------


class Fake:
    """A wire that keeps what was sent, and gives what is put into `incoming`."""

    def __init__(self) -> None:
        self.sent, self.incoming, self.closed = b"", b"", False

    def exchange(self, outgoing: bytes, wait_s: float, stall_s: float) -> bytes:
        del wait_s, stall_s
        self.sent += outgoing
        heard, self.incoming = self.incoming, b""
        return heard

    def close(self) -> None:
        self.closed = True


class Clock:
    def __init__(self) -> None:
        self.now = 100 * S

    def __call__(self) -> int:
        return self.now


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Fake:
    fake = Fake()

    def opener(target: str) -> Callable[[], Fake]:
        del target
        return lambda: fake

    monkeypatch.setattr(port, "opener", opener)
    return fake


def heard(wire: Fake) -> list[Any]:
    """Returns what an autopilot makes of it."""
    decoder = common.MAVLink(None)
    found = decoder.parse_buffer(wire.sent) or []
    assert decoder.total_receive_errors == 0
    wire.sent = b""
    return list(found)


def from_autopilot(message: Any) -> bytes:
    return bytes(message.pack(common.MAVLink(None, srcSystem=7, srcComponent=1)))


def test_poses_come_as_odometry_and_a_heartbeat_once_a_second(wire: Fake) -> None:
    clock = Clock()
    autopilot = Autopilot("udp:x:1", clock_ns=clock)
    for k in range(25):
        clock.now = 100 * S + k * S // 10
        autopilot.odom(odom(t_ns=5 * S + k * S // 10))
    found = heard(wire)
    kinds = [one.get_type() for one in found]
    assert kinds.count("ODOMETRY") == 25
    assert kinds.count("HEARTBEAT") == 3
    assert {one.get_srcComponent() for one in found} == {COMPONENT}
    assert [one.get_seq() for one in found] == list(range(len(found)))
    told = next(one for one in found if one.get_type() == "ODOMETRY")
    assert told.frame_id == common.MAV_FRAME_LOCAL_FRD
    assert told.child_frame_id == common.MAV_FRAME_BODY_FRD
    assert told.estimator_type == common.MAV_ESTIMATOR_TYPE_VIO
    assert (told.x, told.y, told.z) == (3.0, -2.0, -1.0)
    assert told.quality == 100
    np.testing.assert_allclose(told.pose_covariance, fields(odom()).pose_covariance, rtol=1e-6)
    autopilot.close()
    assert wire.closed


def test_timesync_is_answered_on_the_clock_of_the_stamps(wire: Fake) -> None:
    clock = Clock()
    autopilot = Autopilot("udp:x:1", clock_ns=clock)
    ask = common.MAVLink(None).timesync_encode(0, 123456789)
    wire.incoming = from_autopilot(ask)
    autopilot.step(0.0)
    assert "TIMESYNC" not in [one.get_type() for one in heard(wire)]  # no stamp is known yet
    clock.now += 30_000_000  # a pose is 30 ms old when it is told
    autopilot.odom(odom(t_ns=5 * S))
    heard(wire)
    clock.now += 10_000_000
    wire.incoming = from_autopilot(ask)
    autopilot.step(0.0)
    (answer,) = heard(wire)
    assert answer.ts1 == 123456789
    assert answer.tc1 == 5 * S + 10_000_000


def test_an_autopilot_without_gps_is_given_the_origin_once_it_is_heard(wire: Fake) -> None:
    autopilot = Autopilot("udp:x:1", Origin(47.3977, 8.5456, 488.0), clock_ns=Clock())
    beat = common.MAVLink(None).heartbeat_encode
    wire.incoming = from_autopilot(beat(common.MAV_TYPE_GCS, 8, 0, 0, 4))
    autopilot.step(0.0)
    assert [one.get_type() for one in heard(wire)] == ["HEARTBEAT"]  # our own
    wire.incoming = from_autopilot(beat(common.MAV_TYPE_QUADROTOR, 12, 0, 0, 4))
    autopilot.step(0.0)
    (told,) = heard(wire)
    assert told.get_type() == "SET_GPS_GLOBAL_ORIGIN"
    assert (told.target_system, told.latitude, told.longitude) == (7, 473977000, 85456000)
    assert told.altitude == 488000
    wire.incoming = from_autopilot(beat(common.MAV_TYPE_QUADROTOR, 12, 0, 0, 4))
    autopilot.step(0.0)
    assert heard(wire) == []


def test_noise_on_the_line_is_passed_over(wire: Fake) -> None:
    autopilot = Autopilot("udp:x:1", clock_ns=Clock())
    wire.incoming = b"\xfd\xff\x00garbage\xfe\x09" * 5
    autopilot.step(0.0)
    autopilot.odom(odom())
    assert "ODOMETRY" in [one.get_type() for one in heard(wire)]


# --- ports ----------------------------------------------------------------------------------------


def test_a_serial_port_that_vanishes_is_told_and_used_again_when_it_is_back(
    tmp_path: Path,
) -> None:
    device, clock = tmp_path / "ttyACM0", Clock()

    def plug() -> int:
        master, slave = pty.openpty()
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(slave))
        os.close(slave)
        return master

    master = plug()
    serial = Port(f"serial:{device}:115200", clock)
    serial.exchange(b"one", 0.0)
    assert os.read(master, 3) == b"one"
    os.close(master)
    serial.exchange(b"two", 0.0)
    serial.exchange(b"two", 0.0)
    assert "it is tried again each second" in serial.trouble
    assert serial.lost >= 1
    master = plug()
    serial.exchange(b"too early", 0.0)
    clock.now += S
    serial.exchange(b"back", 0.0)
    assert serial.trouble == ""
    assert os.read(master, 4) == b"back"
    serial.close()
    os.close(master)


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ("ttyACM0", "no such port; it may be serial:DEVICE"),
        ("udp:host", "no such port"),
        ("serial:/dev/no-such:57600", "cannot be opened.*is it plugged in"),
        ("serial:/dev/null:12345", "knows no 12345 baud"),
    ],
)
def test_a_port_that_is_misspelt_is_an_error_at_the_start(target: str, says: str) -> None:
    with pytest.raises(PelorusError, match=says):
        Port(target, Clock())


def test_udp_answers_to_who_spoke_last() -> None:
    listening = Udp("127.0.0.1", 0, listens=True)
    here = listening._socket.getsockname()
    assert listening.exchange(b"nobody hears it", 0.0, 0.0) == b""
    peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    peer.sendto(b"hello", here)
    assert listening.exchange(b"", 1.0, 0.0) == b"hello"
    listening.exchange(b"pose", 0.0, 0.0)
    assert peer.recv(100) == b"pose"
    listening.close()


def test_udp_to_a_peer_that_is_not_there_is_no_error() -> None:
    free = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    free.bind(("127.0.0.1", 0))
    where = free.getsockname()[1]
    free.close()
    to = Port(f"udp:127.0.0.1:{where}", Clock())
    for _ in range(3):
        to.exchange(b"pose", 0.01)
    assert to.trouble == ""
