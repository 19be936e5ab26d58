# SPDX-License-Identifier: MIT
"""Clean drives of every kind of robot, as a converter gets them: a rover on a level floor, a drone
whose rotors shake its IMU, a sensor that is carried, one that stands, one that stops and goes; by
twists of which some may not be measured, or by an IMU. Nothing is wrong with any of them, however
little they tell: what is called faulty here is a false alarm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from everyday import LOOKS_AHEAD, ONE_S, Settings, tracks_of, waves
from numpy.typing import NDArray
from pelorus.converters.streams import RawTracks, Readings, Streams, Twists
from pelorus.io.trajectory import Trajectory
from pelorus.math.inertial import GRAVITY_MPS2, Inertial
from pelorus.math.se3 import Poses
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.read import Calibrated
from pelorus.wire.frames import Camera, Header, Noise, TwistTiming
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
FINE_HZ = 400
WHOLE, V_AND_W, V_AND_GYRO, V_ALONE = "v w", "vx wz", "vx gyro", "vx"
BY_IMU = "imu"
MEASURED = {
    WHOLE: frozenset(("vx", "vy", "vz", "wx", "wy", "wz")),
    V_AND_W: frozenset(("vx", "wz")),
    V_AND_GYRO: frozenset(("vx", "wx", "wy", "wz")),
    V_ALONE: frozenset(("vx",)),
}
KINDS = {  # and what may move them
    "rover": (*MEASURED, BY_IMU),
    "drone": (WHOLE, BY_IMU),
    "carried": (WHOLE, BY_IMU),
    "standing": (*MEASURED, BY_IMU),
    "stop and go": (*MEASURED, BY_IMU),
}
NAMES = ("vx", "vy", "vz", "wx", "wy", "wz")


@dataclass(frozen=True)
class Drive:
    """One that was drawn; the truth is the body's at the frames."""

    kind: str
    by: str
    streams: Streams
    truth: Trajectory

    @property
    def name(self) -> str:
        return f"{self.kind}, by {self.by}"


def drive(kind: str, by: str, seed: int) -> Drive:
    """Draws a drive of a kind of robot: speeds, noises, rates, scene and the camera's place."""
    chance = np.random.default_rng([seed, [*KINDS].index(kind), 7])

    def between(low: float, high: float) -> float:
        return float(np.exp(chance.uniform(np.log(low), np.log(high))))

    frame_hz = int(chance.choice([10, 20]))
    duration_s = 600.0 / frame_hz
    settings = Settings(
        kind, 0.0, 0.0, 0.0, 0.0, 0.0, int(chance.choice([20, 50, 100])), frame_hz, "start",
        between(0.3, 1.2), between(0.01, 0.15), between(0.002, 0.03),
        float(chance.choice([0.0, 0.01])), float(chance.choice([0.0, 0.002])), 0.0,
        between(0.08, 0.25), between(8, 25), int(chance.integers(30, 90)),
        float(chance.choice([0.01, 0.04])), float(chance.choice([0.0, 0.02])), duration_s, 0,
    )  # fmt: skip
    t = np.arange(int(duration_s * FINE_HZ) + 1) / FINE_HZ
    v, w = _MOTIONS[kind](t, chance)
    way = _integrated(v, w)
    arm = np.array([0.15, 0.03, 0.2]) * chance.uniform(-1.5, 1.5, 3)
    looks = Rotation.from_euler("x", -float(chance.choice([0.0, 0.0, 12.0])), degrees=True)
    T_CB = Poses(looks.as_matrix() @ LOOKS_AHEAD, -looks.as_matrix() @ LOOKS_AHEAD @ arm)
    focal, size = float(chance.uniform(350, 600)), (752, 480)
    camera = Camera(focal, focal, size[0] / 2, size[1] / 2, settings.baseline_m)
    at = np.arange(FINE_HZ // 2, len(t) - FINE_HZ // 2, FINE_HZ // frame_hz)
    truth = Poses(way.R[at], way.p[at])
    tracks = tracks_of(settings, truth, T_CB, camera, size, chance)
    t_ns = np.round(t * ONE_S).astype(np.int64) + ONE_S
    header = Header(
        camera, T_CB.R, T_CB.p, twist_timing=TwistTiming.MID, image_width_px=size[0],
        image_height_px=size[1], name=f"{kind} {seed}",
    )  # fmt: skip
    here = Path(header.name)
    seen = RawTracks(here, t_ns[at], tracks)
    told = Trajectory(t_ns[at], truth)
    if by == BY_IMU:
        noise, readings = _imu(kind, t_ns, v, w, way, chance)
        calibrated = Calibrated(header, imu=ImuModel(noise))
        return Drive(kind, by, Streams(calibrated, seen, Readings(here, readings), told), told)
    moved = _twists(settings, by, t_ns, v, w, chance)
    if kind == "stop and go" and by == WHOLE and seed % 3 == 0:
        moved = _only_while_moving(moved, t_ns, v, w)
    return Drive(kind, by, Streams(Calibrated(header), seen, moved, told), told)


def chosen(count: int, first_seed: int) -> list[tuple[str, str, int]]:
    """So many, of all kinds in turn and of all that may move them."""
    pairs = [(kind, by) for kind, some in KINDS.items() for by in some]
    by_turns = sorted(pairs, key=lambda pair: (KINDS[pair[0]].index(pair[1]), pair[0]))
    return [(*by_turns[k % len(by_turns)], first_seed + k) for k in range(count)]


# --- how they move --------------------------------------------------------------------------------


def _rover(t: Floats, chance: np.random.Generator) -> tuple[Floats, Floats]:
    """On a level floor: it goes ahead and turns about the vertical, and nothing else."""
    speed = float(np.exp(chance.uniform(np.log(0.4), np.log(2.5))))
    ahead = speed * (1 + waves(t, float(chance.choice([0.0, 0.1, 0.3])), 12.0, chance))
    turns = waves(t, float(chance.uniform(0.1, 0.6)), 12.0, chance)
    none = np.zeros_like(t)
    return np.stack((ahead, none, none), 1), np.stack((none, none, turns), 1)


def _stop_and_go(t: Floats, chance: np.random.Generator) -> tuple[Floats, Floats]:
    """A rover that goes for some seconds and then stands for some."""
    v, w = _rover(t, chance)
    go, stand = chance.uniform(5, 10), chance.uniform(3, 6)
    phase = np.mod(t + float(chance.uniform(0, go)), go + stand)
    edge = 1.0  # s, to set off and to stop
    x = np.clip(np.minimum(phase, go - phase) / edge, 0, 1)
    share = (x * x * (3 - 2 * x))[:, None]
    return v * share, w * share


def _drone(t: Floats, chance: np.random.Generator) -> tuple[Floats, Floats]:
    speed = float(chance.uniform(0.5, 3.0))
    v = [speed * (0.5 + waves(t, 0.4, 10.0, chance))]
    v += [waves(t, 0.3 * speed, 7.0, chance) for _ in range(2)]
    w = [waves(t, float(chance.uniform(0.05, 0.3)), 3.0, chance) for _ in range(2)]
    w += [waves(t, float(chance.uniform(0.1, 0.5)), 8.0, chance)]
    return np.stack(v, 1), np.stack(w, 1)


def _carried(t: Floats, chance: np.random.Generator) -> tuple[Floats, Floats]:
    """At arm's length, any way."""
    speed, turns = float(chance.uniform(0.2, 0.8)), float(chance.uniform(0.2, 0.8))
    v = [waves(t, speed, 3.0, chance) for _ in range(3)]
    w = [waves(t, turns, 3.0, chance) for _ in range(3)]
    return np.stack(v, 1), np.stack(w, 1)


def _standing(t: Floats, _: np.random.Generator) -> tuple[Floats, Floats]:
    return np.zeros((len(t), 3)), np.zeros((len(t), 3))


_MOTIONS = {
    "rover": _rover,
    "drone": _drone,
    "carried": _carried,
    "standing": _standing,
    "stop and go": _stop_and_go,
}


def _integrated(v: Floats, w: Floats) -> Poses:
    """By steps at the mean of both ends."""
    mean_v, mean_w = 0.5 * (v[1:] + v[:-1]), 0.5 * (w[1:] + w[:-1])
    turn = Rotation.from_rotvec(mean_w / FINE_HZ).as_matrix()
    half = Rotation.from_rotvec(mean_w / FINE_HZ / 2).as_matrix()
    R, p = np.empty((len(v), 3, 3)), np.zeros((len(v), 3))
    R[0] = np.eye(3)
    for k in range(len(v) - 1):
        R[k + 1] = R[k] @ turn[k]
        p[k + 1] = p[k] + R[k] @ half[k] @ mean_v[k] / FINE_HZ
    return Poses(R, p)


# --- what they read -------------------------------------------------------------------------------


def _twists(
    settings: Settings, by: str, t_ns: NDArray[np.int64], v: Floats, w: Floats,
    chance: np.random.Generator,
) -> Twists:  # fmt: skip
    """Means about the time of each reading, of what is measured."""
    every = FINE_HZ // settings.twist_hz
    ends = np.arange(0, len(t_ns), every)
    v_B, w_B = (np.diff(_summed(x)[ends], axis=0) * settings.twist_hz for x in (v, w))
    shape = v_B.shape
    v_B = v_B + chance.normal(0, settings.velocity_mps, shape)
    w_B = w_B + chance.normal(0, settings.gyro_radps, shape)
    v_B = v_B + chance.normal(0, 1, 3) * settings.bias_mps
    w_B = w_B + chance.normal(0, 1, 3) * settings.bias_radps
    at = ends[:-1] + every // 2
    there = np.array([name in MEASURED[by] for name in NAMES], np.float64)
    return Twists(Path("twists"), t_ns[at], v_B * there[:3], w_B * there[3:], MEASURED[by])


def _summed(x: Floats) -> Floats:
    steps = 0.5 * (x[1:] + x[:-1]) / FINE_HZ
    return np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


def _only_while_moving(twists: Twists, t_ns: NDArray[np.int64], v: Floats, w: Floats) -> Twists:
    """As some drivers publish it: nothing while the robot stands."""
    moves = np.linalg.norm(np.hstack((v, w)), axis=1)[np.searchsorted(t_ns, twists.t_ns)] > 1e-3
    return replace(
        twists, t_ns=twists.t_ns[moves], v_B_mps=twists.v_B_mps[moves],
        w_B_radps=twists.w_B_radps[moves],
    )  # fmt: skip


def _imu(
    kind: str, t_ns: NDArray[np.int64], v: Floats, w: Floats, way: Poses,
    chance: np.random.Generator,
) -> tuple[Noise, Inertial]:  # fmt: skip
    """200 Hz, with white noise, constant biases, and what rotors shake it by."""
    up = np.array([0.0, 0.0, GRAVITY_MPS2])
    force = np.gradient(v, 1 / FINE_HZ, axis=0) + np.cross(w, v) + up @ way.R
    step = FINE_HZ // 200
    t = (t_ns[::step] - t_ns[0]) * 1e-9
    gyro, accel = (float(np.exp(chance.uniform(*np.log(x)))) for x in ((5e-4, 3e-3), (5e-3, 3e-2)))
    a = force[::step] + chance.normal(0, 0.05, 3) + chance.normal(0, accel * 200**0.5, (len(t), 3))
    g = w[::step] + chance.normal(0, 0.004, 3) + chance.normal(0, gyro * 200**0.5, (len(t), 3))
    if kind == "drone":
        a = a + _shaken(t, float(chance.uniform(0.5, 6.0)), chance)
        g = g + _shaken(t, float(chance.uniform(0.02, 0.3)), chance)
    noise = Noise(gyro_noise=2 * gyro, accel_noise=2 * accel, gyro_walk=1e-4, accel_walk=1e-3)
    return noise, Inertial(t_ns[::step], a, g)


def _shaken(t: Floats, rms: float, chance: np.random.Generator) -> Floats:
    """Three rotors at speeds of their own, which wander a little."""
    out = np.zeros((len(t), 3))
    for _ in range(3):
        hz = float(chance.uniform(40, 160)) * (1 + waves(t, 0.01, 5.0, chance))
        phase = 2 * np.pi * np.cumsum(hz) * float(t[1] - t[0])
        out += np.sin(phase)[:, None] * chance.normal(0, 1, 3)
    return np.asarray(out * rms / np.sqrt(np.mean(out**2)))
