# SPDX-License-Identifier: MIT
"""Drives of rovers, cars and drones that share no code with `pelorus simulate`, each seed one with
settings of its own: rates, speeds, noises, biases, levers and pitch are drawn. Whoever measures how
often a fault is named, or a clean drive called faulty, takes seeds that nobody has seen.

    python tests/python/everyday.py 4711 drive.plr [NAME=VALUE...]     # one of them as a recording
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Camera, Header, Noise, TwistTiming
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
FINE_HZ = 200  # the way is integrated by steps so fine, of which readings are whole parts
WAVES = 4
LOOKS_AHEAD = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # camera of a forward-left-up body
POINTS_A_METRE, POINTS_LEAST = 12.0, 1500
ONE_S = 1_000_000_000


@dataclass(frozen=True)
class Settings:
    """What is drawn of a drive; of speed, turns and wobbles the RMS."""

    kind: str
    speed_mps: float
    speed_varies: float  # share of the speed; 0: it is constant
    turns_radps: float
    wobbles_radps: float  # roll and pitch
    across_mps: float  # velocities across the way
    twist_hz: int
    frame_hz: int
    timing: str
    pixel_px: float
    velocity_mps: float
    gyro_radps: float
    bias_mps: float
    bias_radps: float
    pitch_deg: float
    baseline_m: float
    reach_m: float
    points: int  # tracks of a frame
    loss: float  # of a track, a frame
    outliers: float
    duration_s: float
    told: int  # 1: the HEADER says the noises
    baseline_error: float = 0.0  # the camera's own is so much larger than the HEADER's


def drawn(seed: int) -> Settings:
    """Draws the settings of one seed."""
    chance = np.random.default_rng([seed, 1])

    def between(low: float, high: float) -> float:
        return float(np.exp(chance.uniform(np.log(low), np.log(high))))

    kind = ("rover", "car", "drone")[seed % 3]
    speed = between(*{"rover": (0.4, 2.0), "car": (4.0, 15.0), "drone": (1.0, 6.0)}[kind])
    turns = between(*{"rover": (0.1, 0.5), "car": (0.05, 0.2), "drone": (0.2, 0.8)}[kind])
    wobbles = between(*{"rover": (0.01, 0.1), "car": (0.01, 0.03), "drone": (0.1, 0.5)}[kind])
    return Settings(
        kind,
        speed,
        float(chance.choice([0.0, 0.1, 0.3])),
        turns,
        wobbles,
        (0.1 if kind == "drone" else 0.01) * speed,
        int(chance.choice([10, 20, 50, 100])),
        10,
        str(chance.choice(["start", "mid", "end"])),
        between(0.3, 1.5),
        between(0.02, 0.3),
        between(0.002, 0.05),
        float(chance.choice([0.0, 0.01, 0.03])),
        float(chance.choice([0.0, 0.002, 0.005])),
        float(chance.choice([0.0, 0.0, 10.0, 20.0])) if kind != "car" else 0.0,
        between(0.1, 0.3) if kind != "car" else between(0.3, 0.6),
        between(10, 20) if kind == "rover" else between(30, 60),
        int(chance.integers(30, 100)),
        float(chance.choice([0.01, 0.05])),
        float(chance.choice([0.0, 0.02])),
        30.0,
        int(chance.integers(2)),
    )


def drive(settings: Settings, seed: int) -> Recording:
    """With the truth, at the frames."""
    chance = np.random.default_rng([seed, 2])
    count = int(settings.duration_s * FINE_HZ) + 1
    way = _way(settings, count, chance)
    t_ns = np.arange(count) * (ONE_S // FINE_HZ) + ONE_S
    every = FINE_HZ // settings.twist_hz
    v, w = _readings(settings, way, every, chance)
    looks = Rotation.from_euler("x", -settings.pitch_deg, degrees=True).as_matrix() @ LOOKS_AHEAD
    arm = np.array([0.25, 0.05, 0.3]) * chance.uniform(0.5, 1.5, 3)
    if settings.kind == "car":
        arm *= 4
    T_CB = Poses(looks, -looks @ arm)
    focal, size = float(chance.uniform(350, 700)), (752, 480)
    told = Camera(focal, focal, size[0] / 2, size[1] / 2, settings.baseline_m)
    true = replace(told, baseline_m=told.baseline_m * (1 + settings.baseline_error))
    at = np.arange(0, count, FINE_HZ // settings.frame_hz)
    tracks = tracks_of(settings, Poses(way.R[at], way.p[at]), T_CB, true, size, chance)
    noise = Noise(
        settings.pixel_px, settings.velocity_mps, settings.gyro_radps,
        settings.bias_mps, settings.bias_radps,
    )  # fmt: skip
    timing = TwistTiming[settings.timing.upper()]
    header = Header(
        told, T_CB.R, T_CB.p, twist_timing=timing, image_width_px=size[0], image_height_px=size[1],
        noise=noise if settings.told else Noise(), name=f"{settings.kind} {seed}",
    )  # fmt: skip
    truth = Poses(way.R[at], way.p[at])
    return Recording(header, t_ns[::every], v, w, t_ns[at], tracks, t_ns[at], truth)


def waves(t: Floats, rms: float, slowest_s: float, chance: np.random.Generator) -> Floats:
    """Some sines of periods down to a quarter of the slowest."""
    period = slowest_s * chance.uniform(0.25, 1.0, WAVES)
    phase = chance.uniform(0, 2 * np.pi, WAVES)
    size = chance.uniform(0.5, 1.0, WAVES)
    size *= rms * np.sqrt(2) / np.linalg.norm(size)
    return np.asarray(np.sin(2 * np.pi * t[:, None] / period + phase) @ size)


def _way(settings: Settings, count: int, chance: np.random.Generator) -> Poses:
    """Steps at a constant velocity each."""
    t = np.arange(count) / FINE_HZ
    ahead = settings.speed_mps * (1 + waves(t, settings.speed_varies, 12.0, chance))
    across = [waves(t, settings.across_mps, 6.0, chance) for _ in range(2)]
    v = np.stack((ahead, *across), axis=1)
    w = np.stack(
        [waves(t, settings.wobbles_radps, 3.0, chance) for _ in range(2)]
        + [waves(t, settings.turns_radps, 15.0, chance)],
        axis=1,
    )
    turn = Rotation.from_rotvec(w / FINE_HZ).as_matrix()
    half = Rotation.from_rotvec(w / FINE_HZ / 2).as_matrix()
    R, p = np.empty((count, 3, 3)), np.zeros((count, 3))
    R[0] = np.eye(3)
    for k in range(count - 1):
        R[k + 1] = R[k] @ turn[k]
        p[k + 1] = p[k] + R[k] @ half[k] @ v[k] / FINE_HZ
    return Poses(R, p)


def _readings(
    settings: Settings, way: Poses, every: int, chance: np.random.Generator
) -> tuple[Floats, Floats]:
    """Mean twists over one period: behind the time of the reading, before it, or about it."""
    at = np.arange(0, len(way.p), every)
    first, last = {
        "start": (at, at + every),
        "end": (at - every, at),
        "mid": (at - every // 2, at - every // 2 + every),
    }[settings.timing]
    first, last = (np.clip(x, 0, len(way.p) - 1) for x in (first, last))
    tau = np.maximum(last - first, 1)[:, None] / FINE_HZ
    turn = Rotation.from_matrix(np.swapaxes(way.R[first], 1, 2) @ way.R[last]).as_rotvec()
    step = np.einsum("nji,nj->ni", way.R[first], way.p[last] - way.p[first])
    step = Rotation.from_rotvec(-turn / 2).apply(step)  # of a small turn the twist's velocity
    shape = (len(at), 3)
    v = step / tau + chance.normal(0, settings.velocity_mps, shape)
    w = turn / tau + chance.normal(0, settings.gyro_radps, shape)
    return (
        v + chance.normal(0, 1, 3) * settings.bias_mps,
        w + chance.normal(0, 1, 3) * settings.bias_radps,
    )


def tracks_of(
    settings: Settings,
    truth: Poses,
    T_CB: Poses,
    camera: Camera,
    size: tuple[int, int],
    chance: np.random.Generator,
) -> Tracks:
    """Points about the way; a track that ends comes back as another."""
    length = float(np.sum(np.linalg.norm(np.diff(truth.p, axis=0), axis=1)))
    count = max(POINTS_LEAST, int(POINTS_A_METRE * length))
    about = truth.p[chance.integers(0, len(truth.p), count)]
    spread = settings.reach_m * np.array([0.6, 0.6, 0.2])
    world = about + chance.uniform(-1, 1, (count, 3)) * spread
    id_of, next_id = np.full(count, -1), 0
    rows: list[tuple[NDArray[np.int64], NDArray[np.int64], Floats]] = []
    for k in range(len(truth.p)):
        q = ((world - truth.p[k]) @ truth.R[k]) @ T_CB.R.T + T_CB.p
        z = np.maximum(q[:, 2], 1e-3)
        u = camera.cx_px + camera.fx_px * q[:, 0] / z
        disparity = camera.fx_px * camera.baseline_m / z
        v = camera.cy_px + camera.fy_px * q[:, 1] / z
        seen = (q[:, 2] > 0.05 * settings.reach_m) & (q[:, 2] < settings.reach_m)
        seen &= (u - disparity > 0) & (u < size[0]) & (v > 0) & (v < size[1])
        id_of[~seen | (chance.random(count) < settings.loss)] = -1
        free = np.nonzero(seen & (id_of < 0))[0]
        wanted = settings.points - int(np.sum(id_of >= 0))
        new = chance.permutation(free)[: max(wanted, 0)]
        id_of[new] = next_id + np.arange(len(new))
        next_id += len(new)
        held = np.nonzero(id_of >= 0)[0]
        px = np.stack((u, v, u - disparity, v), axis=1)[held]
        px += chance.normal(0, settings.pixel_px, px.shape)
        wrong = chance.random(len(held)) < settings.outliers
        px[wrong] += chance.uniform(-30, 30, (int(wrong.sum()), 4)) * [1, 0.05, 1, 0.05]
        rows.append((np.full(len(held), k), id_of[held], px))
    frame, id, px = (np.concatenate([row[j] for row in rows]) for j in range(3))
    return Tracks.from_rows(len(truth.p), frame, id, px)


def main(seed: str, path: str, *changes: str) -> None:
    """Write one, with some of its settings replaced."""
    settings = drawn(int(seed))
    kinds = {field.name: type(getattr(settings, field.name)) for field in fields(settings)}
    for change in changes:
        name, value = change.split("=")
        settings = replace(settings, **{name: kinds[name](value)})
    drive(settings, int(seed)).write(Path(path))
    print(settings)


if __name__ == "__main__":
    main(*sys.argv[1:])
