# SPDX-License-Identifier: MIT
"""Wheels beside a camera with an IMU: their speeds of a table, or as datagrams of JSON.

They sit on the robot: axes forward, left, up, as --mount has them.
"""

from __future__ import annotations

import heapq
import socket
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from pelorus.converters import wheels
from pelorus.errors import PelorusError
from pelorus.io import foreign
from pelorus.live.camera import Camera, Measured
from pelorus.live.session import on_camera
from pelorus.online.pipeline import header_of
from pelorus.wire.frames import Reading

BYTES_MAX = 1000
EXPECTED = "v_mps, or left_mps and right_mps, with t_ns or t_s if it has a stamp,"


class Speeds(NamedTuple):
    """Of the middle of the axle, or of the left and the right wheel; `t_ns` None: now."""

    t_ns: int | None
    v_mps: tuple[float, ...]


@dataclass(frozen=True)
class WheelsAsked:
    """What the user says of the wheels."""

    source: str  # udp:PORT, or a table
    sigma_mps: float = 0.03
    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)  # the middle of the axle on the robot
    track_m: float = 0.0


def speeds_of(row: Mapping[str, object]) -> Speeds:
    """Returns what a row or an object says; ValueError where it says nothing."""
    stamp: int | None = None
    if "t_ns" in row:
        stamp = int(str(row["t_ns"]))
    elif "t_s" in row:
        stamp = round(float(str(row["t_s"])) * 1e9)
    names = ("v_mps",) if "v_mps" in row else ("left_mps", "right_mps")
    if not set(names) <= set(row):
        raise ValueError(f"{EXPECTED} is expected")
    found = tuple(float(str(row[name])) for name in names)
    if not np.isfinite(found).all():
        raise ValueError(f"{found} are not finite")
    return Speeds(stamp, found)


class Source(Protocol):
    """Where speeds come from."""

    def until(self, t_ns: int) -> Iterator[Speeds]:
        """Returns those that have come up to this measurement of the camera."""

    def close(self) -> None: ...


class Table:
    """A CSV file in the order of its times."""

    def __init__(self, path: Path) -> None:
        table = foreign.csv_rows(path)
        try:
            rows = [speeds_of(dict(zip(table.names, row, strict=True))) for row in table.rows]
        except ValueError as error:
            raise PelorusError(f"--wheels {path}: {error}") from None
        stamps = [row.t_ns for row in rows if row.t_ns is not None]
        if not rows or len(stamps) < len(rows):
            raise PelorusError(f"--wheels {path}: columns t_ns or t_s, and {EXPECTED} are expected")
        self._rows = deque(sorted(rows, key=lambda row: row.t_ns or 0))

    def until(self, t_ns: int) -> Iterator[Speeds]:
        while self._rows and (self._rows[0].t_ns or 0) <= t_ns:
            yield self._rows.popleft()

    def close(self) -> None:
        pass


class Datagrams:
    """JSON by UDP. What is none is counted, as `bad`."""

    def __init__(self, port: str) -> None:
        self.bad = 0
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            self._socket.bind(("", int(port)))
        except (OSError, ValueError, OverflowError):
            raise PelorusError(
                f"--wheels udp:{port}: a free port is expected, as in udp:9871"
            ) from None

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def until(self, t_ns: int) -> Iterator[Speeds]:
        del t_ns
        while True:
            try:
                words = self._socket.recv(BYTES_MAX).decode()
                yield speeds_of(foreign.json_words(Path("datagram"), words))
            except BlockingIOError:
                return
            except (ValueError, PelorusError):
                self.bad += 1

    def close(self) -> None:
        self._socket.close()


class Beside:
    """A camera with wheels: whatever it measures, and the speeds that have come by then."""

    inertial: bool = True  # else it is refused

    def __init__(self, camera: Camera, asked: WheelsAsked, mount: Sequence[float]) -> None:
        if not camera.inertial:
            raise PelorusError(f"--wheels go beside an IMU, and {camera.name} has none")
        if not asked.sigma_mps > 0:
            raise PelorusError(f"--wheel-sigma is {asked.sigma_mps:g}: more than 0 is expected")
        self._camera, self._asked = camera, asked
        self._T_IB = on_camera(mount, header_of(camera.calibrated, camera.inertial))
        form, colon, port = asked.source.partition(":")
        is_udp = bool(colon) and form == "udp"
        self.source: Source = Datagrams(port) if is_udp else Table(Path(asked.source))
        self.name, self.calibrated = camera.name, camera.calibrated
        self.recorded = camera.recorded
        self.remarks: Sequence[str] = camera.remarks
        self.settings: dict[str, float] = getattr(camera, "settings", {})

    def measured(self) -> Iterator[Measured]:
        for one in self._camera.measured():
            told = [
                m for speeds in self.source.until(one.t_ns) for m in self._readings(speeds, one)
            ]
            yield from heapq.merge(told, key=lambda m: m.t_ns)
            yield one

    def close(self) -> None:
        self.source.close()
        self._camera.close()

    def _readings(self, speeds: Speeds, beside: Measured) -> Iterator[Reading]:
        """Returns a reading for each wheel, in the body's axes."""
        t_ns = beside.t_ns if speeds.t_ns is None else speeds.t_ns
        half = self._asked.track_m / 2 if len(speeds.v_mps) > 1 else 0.0
        for v, side in zip(speeds.v_mps, (half, -half), strict=False):
            rolling = wheels.Rolling(
                np.array([t_ns]),
                np.array([[v, 0.0, 0.0]]),
                np.array([[self._asked.sigma_mps] * 3]),
                "x",
            )
            at_m = np.array(self._asked.at_m) + np.array([0.0, side, 0.0])
            yield from wheels.readings(rolling, self._T_IB, at_m, self._asked.sigma_mps)
