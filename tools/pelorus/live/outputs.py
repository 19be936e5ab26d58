# SPDX-License-Identifier: MIT
"""Where poses go: an output takes each, and never keeps the next one waiting."""

from __future__ import annotations

import json
import socket
from typing import Protocol

import scipy

from pelorus.errors import PelorusError
from pelorus.evaluate.health import reasons
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
