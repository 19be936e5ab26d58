# SPDX-License-Identifier: MIT
"""An autopilot, PX4 or ArduPilot, as a listener to ODOMETRY.

Beside it they expect: HEARTBEAT once a second of a component 197 (visual inertial odometry);
answers to TIMESYNC on the clock of ODOMETRY's stamps, or they cannot tell how old a pose is; and
without GPS a place on the earth for the origin (SET_GPS_GLOBAL_ORIGIN), once they are heard.

ODOMETRY (331) is in MAV_FRAME_LOCAL_FRD and MAV_FRAME_BODY_FRD. `odom` and the base are
forward-left-up; M = diag(1, -1, -1) brings vectors of either into the autopilot's axes, and
rotations to M R M. LOCAL_FRD, not NED: x is where the base looked when it began. The covariance is
of (x, y, z, roll, pitch, yaw): with T = T^ Exp(rho, theta) to first order

    d(x, y, z) = R rho        d(roll, pitch, yaw) = E theta

E = [1, sr tp, cr tp; 0, cr, -sr; 0, sr/cp, cr/cp]; it has no meaning within 3 degrees of straight
up or down. port/mavlink/odometry.h is the same for firmware.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy

from pelorus.live.camera import OtherClock
from pelorus.live.port import Port
from pelorus.online.drive import UNKNOWN_COVARIANCE
from pelorus.online.odometry import Odom
from pelorus.program.extras import extra
from pelorus.wire.frames import UNKNOWN_VARIANCE
from pelorus.wire.layout import Floats

M = np.diag([1.0, -1.0, -1.0])
BOTH = np.kron(np.eye(2), M)
COS_PITCH_LEAST = 0.05
QUALITIES = {0: 100, 1: 50, 2: 1}  # percent, by health; -1 is failed
UPPER = np.triu_indices(6)
UNKNOWN = np.full(21, np.nan)


class Fields(NamedTuple):
    """Those of the message; covariances (21,) are upper triangles, row by row, the first number NaN
    where nothing is known."""

    time_usec: int
    p: Floats
    q_wxyz: Floats
    v: Floats
    w: Floats
    pose_covariance: Floats
    velocity_covariance: Floats
    reset_counter: int
    quality: int


def fields(odom: Odom) -> Fields:
    """Returns the message's fields."""
    R = M @ odom.T_OB.R @ M
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(R).as_quat(canonical=True)
    velocity = BOTH @ odom.velocity
    return Fields(
        odom.t_ns // 1000,
        M @ odom.T_OB.p,
        np.array([w, x, y, z]),
        velocity[:3],
        velocity[3:],
        _pose_covariance(R, odom.covariance),
        _upper(BOTH @ odom.velocity_covariance @ BOTH),
        odom.reset_count % 256,
        QUALITIES.get(odom.estimate.health, -1),
    )


def euler_rates(R: Floats) -> Floats | None:
    """Returns E; None where roll and yaw cannot be told apart."""
    cp = float(np.hypot(R[2, 1], R[2, 2]))
    if cp <= COS_PITCH_LEAST:
        return None
    sr, cr, tp = R[2, 1] / cp, R[2, 2] / cp, -R[2, 0] / cp
    return np.array([[1, sr * tp, cr * tp], [0, cr, -sr], [0, sr / cp, cr / cp]])


def _pose_covariance(R: Floats, P: Floats) -> Floats:
    E = euler_rates(R)
    if E is None:
        return UNKNOWN
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = R, E
    return _upper(J @ BOTH @ P @ BOTH @ J.T)


def _upper(C: Floats) -> Floats:
    known = np.isfinite(C).all() and C[0, 0] < min(UNKNOWN_VARIANCE, UNKNOWN_COVARIANCE[0, 0])
    return C[UPPER] if known else UNKNOWN


COMPONENT = 197  # MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
HEARTBEAT_NS = 1_000_000_000
WAIT_S = 0.005  # TIMESYNC is answered as quickly
WAITING_MOST = 4  # poses that may wait for a slow port; the newest are worth most
OWN_KINDS = {5, 6, 18, 26, 27, 30}  # MAV_TYPE of ground stations, companions, gimbals, cameras


class Origin(NamedTuple):
    """Where `odom` begins on the earth, for an autopilot without GPS."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class Autopilot:
    """Speaks over a port. `step` does what there is to do; `start` lets a thread do it."""

    def __init__(
        self,
        target: str,
        origin: Origin | None = None,
        system: int = 1,
        clock_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        with extra("pymavlink"):
            from pymavlink.dialects.v20 import common  # noqa: PLC0415 - it is large
        self._dialect: Any = common
        self._mav: Any = common.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        self._mav.robust_parsing = True
        self._clock_ns, self._origin = clock_ns, origin
        self.port = Port(target, clock_ns)
        self.heard: Any = None  # the autopilot's HEARTBEAT
        self._stamps = OtherClock()
        self._waiting: deque[Odom] = deque(maxlen=WAITING_MOST)
        self._beat_ns = clock_ns() - HEARTBEAT_NS
        self._end = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def trouble(self) -> str:
        return self.port.trouble

    def odom(self, odom: Odom) -> None:
        self._stamps.heard(odom.t_ns, self._clock_ns())
        self._waiting.append(odom)
        if self._thread is None:
            self.step(0.0)

    def step(self, wait_s: float) -> None:
        """Sends what waits, and answers what comes within `wait_s`."""
        outgoing = b""
        while self._waiting:
            outgoing += self._odometry(self._waiting.popleft())
        now = self._clock_ns()
        if now - self._beat_ns >= HEARTBEAT_NS:
            self._beat_ns = now
            outgoing += self._heartbeat()
        incoming = self.port.exchange(outgoing, wait_s)
        for message in self._mav.parse_buffer(incoming) or []:
            if answer := self._answer(message):
                self.port.exchange(answer, 0.0)

    def start(self) -> None:
        """From now on a thread of its own does it."""
        self._thread = threading.Thread(target=self._run, name="autopilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._end.set()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        self.step(0.0)
        self.port.close()

    def _run(self) -> None:
        while not self._end.is_set():
            self.step(WAIT_S)
            if self.port.trouble:
                self._end.wait(0.1)

    def _packed(self, message: Any) -> bytes:
        packed = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return packed

    def _odometry(self, odom: Odom) -> bytes:
        d, f = self._dialect, fields(odom)
        return self._packed(
            self._mav.odometry_encode(
                f.time_usec, d.MAV_FRAME_LOCAL_FRD, d.MAV_FRAME_BODY_FRD,
                *f.p.tolist(), f.q_wxyz.tolist(), *f.v.tolist(), *f.w.tolist(),
                f.pose_covariance.tolist(), f.velocity_covariance.tolist(),
                f.reset_counter, d.MAV_ESTIMATOR_TYPE_VIO, f.quality,
            )
        )  # fmt: skip

    def _heartbeat(self) -> bytes:
        d = self._dialect
        return self._packed(
            self._mav.heartbeat_encode(
                d.MAV_TYPE_ONBOARD_CONTROLLER, d.MAV_AUTOPILOT_INVALID, 0, 0, d.MAV_STATE_ACTIVE
            )
        )

    def _answer(self, message: Any) -> bytes:
        """Returns what a message asks for."""
        kind = message.get_type()
        if kind == "TIMESYNC" and message.tc1 == 0:
            now = self._stamps.at(self._clock_ns())
            return b"" if now is None else self._packed(self._mav.timesync_encode(now, message.ts1))
        if kind == "HEARTBEAT" and message.type not in OWN_KINDS and self.heard is None:
            self.heard = message
            return self._first_words(message)
        return b""

    def _first_words(self, message: Any) -> bytes:
        if self._origin is None:
            return b""
        lat, lon, alt = self._origin
        return self._packed(
            self._mav.set_gps_global_origin_encode(
                message.get_srcSystem(), round(lat * 1e7), round(lon * 1e7), round(alt * 1e3)
            )
        )
