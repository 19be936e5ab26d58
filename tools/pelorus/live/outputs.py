# SPDX-License-Identifier: MIT
"""Where poses go: an output takes each, and never keeps the next one waiting; and in words."""

from __future__ import annotations

import json
import re
import socket
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
import scipy

from pelorus.errors import PelorusError
from pelorus.evaluate.health import reasons
from pelorus.online.diagnosis import Status
from pelorus.online.odometry import Odom, turned
from pelorus.wire import schema
from pelorus.wire.layout import Floats


class Output(Protocol):
    """Takes poses."""

    @property
    def trouble(self) -> str:
        """Returns what is wrong with it now."""

    def odom(self, odom: Odom) -> None: ...

    def close(self) -> None: ...


def as_object(odom: Odom) -> dict[str, object]:
    """Returns the pose of the base in `odom`, axes forward, left, up, as one JSON object.

    Covariances are 6 x 6 by rows: of x y z rotx roty rotz about the axes of `odom`, as ROS has
    them, and of the velocity in the base's own axes.
    """
    health = odom.estimate.health
    return {
        "t_ns": odom.t_ns,
        "position_m": _rounded(odom.T_OB.p),
        "orientation_xyzw": _rounded(
            scipy.spatial.transform.Rotation.from_matrix(odom.T_OB.R).as_quat()
        ),
        "covariance": _rounded(turned(odom.T_OB.R, odom.covariance).ravel()),
        "velocity_mps": _rounded(odom.velocity[:3]),
        "rate_radps": _rounded(odom.velocity[3:]),
        "velocity_covariance": _rounded(odom.velocity_covariance.ravel()),
        "health": schema.HEALTHS.get(health, str(health)),
        "reasons": list(reasons(odom.estimate.reasons)),
        "reset_count": odom.reset_count,
    }


def _rounded(values: Floats) -> list[float]:
    return [float(f"{value:.9g}") for value in values]


class Datagrams:
    """Each pose as a datagram of JSON. Nobody need listen."""

    def __init__(self, target: str) -> None:
        host, _, port = target.rpartition(":")
        if not (host and port.isdecimal() and 0 < int(port) < 65536):
            raise PelorusError(f"--udp {target!r}: HOST:PORT is expected, as in 127.0.0.1:9870")
        self.trouble, self._target = "", target
        try:
            self._peer = socket.getaddrinfo(host, int(port), type=socket.SOCK_DGRAM)[0]
        except OSError as error:
            raise PelorusError(f"--udp {target}: no such host: {error.strerror}") from error
        self._socket = socket.socket(self._peer[0], socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def odom(self, odom: Odom) -> None:
        words = json.dumps(as_object(odom)).encode()
        try:
            self._socket.sendto(words, self._peer[4])
        except BlockingIOError:
            return  # the next one is newer
        except OSError as error:
            self.trouble = f"--udp {self._target}: {error.strerror}; is the network up?"
            return
        self.trouble = ""

    def close(self) -> None:
        self._socket.close()


# --- in words -------------------------------------------------------------------------------------


RATE_OVER_NS = 2_000_000_000
NUMBERS = re.compile(r"[-+]?\d[\d.e+-]*")


class HealthLine:
    """`12.3 s  x 1.23  y 0.10  z 0.02 m +-0.012  yaw 12.3 deg +-0.2  good  42 points  20 Hz`."""

    def __init__(self) -> None:
        self._begin_ns: int | None = None
        self._frames: deque[int] = deque()

    def of(self, odom: Odom) -> str:
        """Returns the line after a pose."""
        self._begin_ns = odom.t_ns if self._begin_ns is None else self._begin_ns
        self._frames.append(odom.t_ns)
        while self._frames[-1] - self._frames[0] > RATE_OVER_NS:
            self._frames.popleft()
        span_s = (self._frames[-1] - self._frames[0]) * 1e-9
        rate = f"  {(len(self._frames) - 1) / span_s:.0f} Hz" if span_s > 0 else ""
        x, y, z = odom.T_OB.p
        yaw = np.degrees(np.arctan2(odom.T_OB.R[1, 0], odom.T_OB.R[0, 0]))
        place, turn = np.sqrt(np.diag(odom.covariance).reshape(2, 3).sum(axis=1))
        report = odom.estimate.report
        points = "no frame" if report is None else f"{report.used} points"
        health = schema.HEALTHS.get(odom.estimate.health, str(odom.estimate.health))
        return (
            f"{(odom.t_ns - self._begin_ns) * 1e-9:.1f} s  x {x:.3f}  y {y:.3f}  z {z:.3f} m "
            f"+-{place:.2g}  yaw {yaw:.1f} deg +-{np.degrees(turn):.2g}  {health}  {points}{rate}"
        )


class News:
    """What was not said before; numbers that change are no news."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def of(self, found: Sequence[Status]) -> Iterator[str]:
        """Returns a line for each thing that is new, and forgets what has passed."""
        now = {f"{one.name}: {NUMBERS.sub('#', one.message)}": one for one in found}
        fresh = [one for key, one in now.items() if key not in self._said]
        self._said = set(now)
        for one in fresh:
            yield f"{one.name}: {one.message}" + (f"; {one.do}" if one.do else "")
