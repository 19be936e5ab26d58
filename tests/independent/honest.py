# SPDX-License-Identifier: MIT
"""Is the covariance honest? A world that shares nothing with the other tests, in numpy alone: its
own motion, camera, noise and logarithm. Of the project it uses pelorus.Filter.

usage: honest.py [--imu] [--runs 50] [--seconds 24] [--float64] [--told NAME=VALUE]
       honest.py --table [--runs 32] [--seconds 60]

A robot drives at 1 m/s among 30 tracks at 2 to 30 m, 1 px, 10 frames a second, a stereo pair 12 cm
wide; twists come at 50 Hz, with --imu readings of an IMU at 200 Hz instead. All that the filter
takes for uncertain is drawn from what it is told: noises, biases and their walks, the start, focal
length, baseline, the camera's turn on the body. Then the squared error of the pose over its
covariance (NEES) is chi-square with 6 degrees of freedom, and the sum over independent runs with 6
a run. Exit status 1 if it is beyond bounds at a checkpoint, which an honest filter would be in one
of a thousand calls. --told gives the filter a setting.

--table: what if something is wrong that the filter is not told? First with a camera that it takes
for exact, then with default settings: the share of frames that are GOOD though an error is beyond
5 sigma, and NEES/6; then with defaults the RMS position error and the filter's own sigma, m.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pelorus import Calibration, Filter, observations
from pelorus.native.binding import Precision
from scipy.stats import chi2

Floats = NDArray[np.float64]
Config = dict[str, float | str]

STEP_S, FRAME_STEPS = 0.02, 5
FX, CX, CY, WIDTH, HEIGHT, BASELINE_M = 400.0, 320.0, 240.0, 640, 480, 0.12
TRACKS, NEAR_M, FAR_M, LOST_M = 30, 2.0, 30.0, 0.5
R_CB = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # body: forward, right, down
T_CB = np.array([0.02, -0.01, -0.1])
PIXEL_SIGMA = 1.0
GOOD = 0  # of plr_health
# The defaults of include/pelorus/settings.h.
VELOCITY_SIGMA, GYRO_SIGMA = 0.1, 0.01
BIAS_SIGMA = np.repeat([0.005, 0.01], 3)
BIAS_WALK = np.repeat([1e-8, 1e-10], 3)
FOCAL_SIGMA, BASELINE_SIGMA, TURN_SIGMA = 0.005, 0.005, 0.003
# By an IMU: its densities and walks, as the defaults have them, and what is known at first.
GRAVITY_W = np.array([0.0, 0, -9.81])
IMU_S, IMU_PER_FRAME = 0.005, 20
IMU_NOISE, IMU_WALK = np.repeat([0.01, 0.001], 3), np.repeat([0.001, 0.0001], 3)
IMU_BIAS_SIGMA = np.repeat([0.05, 0.005], 3)
START_SIGMA = np.repeat([0.001, 0.01, 0.1], 3)  # of the pose and of the velocity in the body
EXACT: Config = {"focal-sigma": 0.0, "baseline-sigma": 0.0, "camera-turn-sigma": 0.0}


@dataclass(frozen=True)
class Wrong:
    """What the filter is not told; with the defaults only what is `drawn` from its settings."""

    drawn: bool = False  # the camera is wrong by as much as the filter takes for possible
    askew_deg: float = 0.0
    correlation: float = 0.0  # of a track's pixel errors, from frame to frame
    wander: float = 0.0  # px/sqrt(s)
    moving: float = 0.0  # the share of points that move along, at a fifth of the body's speed
    shutter_s: float = 0.0  # from the first row to the last


@dataclass(frozen=True)
class Outcome:
    """All runs: arrays (runs, frames), and the errors and sigmas (runs, frames, 6)."""

    nees: Floats
    error: Floats
    sigma: Floats
    good: NDArray[np.bool_]

    def silent(self) -> float:
        """Returns the share of the frames that are GOOD though an error is beyond 5 sigma."""
        beyond = (abs(self.error) > 5 * self.sigma).any(axis=2)
        return float((beyond & self.good).mean())


# --- rotations: Rodrigues' formula and its inverse ------------------------------------------------


def cross_matrix(w: Floats) -> Floats:
    """Returns (..., 3, 3) of (..., 3)."""
    zero = np.zeros_like(w[..., 0])
    rows = (zero, -w[..., 2], w[..., 1], w[..., 2], zero, -w[..., 0], -w[..., 1], w[..., 0], zero)
    return np.stack(rows, axis=-1).reshape(*w.shape, 3)


def turned(w: Floats) -> tuple[Floats, Floats]:
    """Returns exp([w]x), and the matrix V with V rho the translation of a screw."""
    angle = np.maximum(np.linalg.norm(w, axis=-1), 1e-12)[..., None, None]
    K = cross_matrix(w)
    R = np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K
    V = np.eye(3) + (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * K @ K
    return R, V


def screw(R: Floats, p: Floats) -> Floats:
    """Returns (rho, theta) of a motion that turns by less than half a turn."""
    sine = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    angle = np.arctan2(np.linalg.norm(sine), (np.trace(R) - 1) / 2)
    theta = sine * (angle / np.sin(angle) if angle > 1e-6 else 1.0)
    return np.concatenate((np.linalg.solve(turned(theta)[1], p), theta))


# --- the world ------------------------------------------------------------------------------------


def twists(rng: np.random.Generator, steps: int) -> Floats:
    """Returns true velocity and rate in the body, (steps, 6), each held for a step."""
    t = np.arange(steps) * STEP_S
    largest = np.array([0.3, 0.05, 0.05, 0.05, 0.05, 0.4])
    hertz, phase = rng.uniform(0.03, 0.3, (3, 6)), rng.uniform(0, 2 * np.pi, (3, 6))
    waves = np.sin(2 * np.pi * t[:, None, None] * hertz + phase).sum(axis=1) / np.sqrt(3)
    found: Floats = largest * waves + np.array([1.0, 0, 0, 0, 0, 0])
    return found


class Camera:
    """The true camera, which projects points and follows tracks."""

    def __init__(self, rng: np.random.Generator, wrong: Wrong) -> None:
        drawn = rng.normal(size=5) * wrong.drawn
        axis = rng.normal(size=3)
        askew = np.radians(wrong.askew_deg) * axis / np.linalg.norm(axis)
        self.focal = FX * (1 + FOCAL_SIGMA * drawn[0])
        self.baseline_m = BASELINE_M * (1 + BASELINE_SIGMA * drawn[1])
        self.R = turned(TURN_SIGMA * drawn[2:] + askew)[0] @ R_CB
        self.rng, self.wrong = rng, wrong
        self.points, self.ids = np.empty((0, 3)), np.empty(0, int)
        self.noise, self.offset = np.empty((0, 4)), np.empty((0, 2))
        self.moves = np.empty(0, bool)
        self.next_id = 1

    def in_camera(self, R: Floats, p: Floats) -> Floats:
        q: Floats = (self.points - p) @ R @ self.R.T + T_CB
        return q

    def pixels(self, q: Floats) -> Floats:
        """Returns (n, 4) of uL, vL, uR, vR."""
        u, v = CX + self.focal * q[:, 0] / q[:, 2], CY + self.focal * q[:, 1] / q[:, 2]
        return np.stack((u, v, u - self.focal * self.baseline_m / q[:, 2], v), axis=1)

    def look(self, R: Floats, p: Floats, twist: Floats) -> tuple[NDArray[np.int_], Floats]:
        """Returns the ids and pixels of a frame; then replaces points that left the picture."""
        q = self.in_camera(R, p)
        if self.wrong.shutter_s:  # a row is read after the camera has moved on
            late = self.wrong.shutter_s * (self.pixels(q)[:, 1:2] / HEIGHT - 0.5)
            flow = (-twist[:3] - np.cross(twist[3:], (q - T_CB) @ self.R)) @ self.R.T
            q = q + late * flow
        pixels = self.pixels(q)
        inside = (q[:, 2] > LOST_M) & (pixels > 0).all(axis=1)
        inside &= (pixels[:, 0] < WIDTH) & (pixels[:, 1] < HEIGHT)
        self._keep(inside)
        self._replace(R, p)
        pixels = self.pixels(self.in_camera(R, p)) if not self.wrong.shutter_s else pixels[inside]
        seen = len(pixels)
        rho = self.wrong.correlation
        fresh = self.rng.normal(size=self.noise.shape) * PIXEL_SIGMA
        older = rho * self.noise + np.sqrt(1 - rho**2) * fresh
        self.noise = np.where(np.isnan(self.noise), fresh, older)
        step = self.wrong.wander * np.sqrt(STEP_S * FRAME_STEPS)
        self.offset = self.offset + self.rng.normal(size=self.offset.shape) * step
        drift = np.tile(self.offset, 2)[:seen]
        return self.ids[:seen], pixels + self.noise[:seen] + drift

    def move(self, way: Floats) -> None:
        """Moves the points that move along."""
        self.points = self.points + np.outer(self.moves, 0.2 * way)

    def _keep(self, which: NDArray[np.bool_]) -> None:
        self.points, self.ids, self.moves = self.points[which], self.ids[which], self.moves[which]
        self.noise, self.offset = self.noise[which], self.offset[which]

    def _replace(self, R: Floats, p: Floats) -> None:
        n = TRACKS - len(self.points)
        depth = NEAR_M * (FAR_M / NEAR_M) ** self.rng.uniform(size=n)
        u, v = self.rng.uniform(60, WIDTH - 20, n), self.rng.uniform(20, HEIGHT - 20, n)
        q = np.stack(((u - CX) / FX * depth, (v - CY) / FX * depth, depth), axis=1)
        self.points = np.vstack((self.points, (q - T_CB) @ self.R @ R.T + p))
        self.ids = np.concatenate((self.ids, np.arange(self.next_id, self.next_id + n)))
        self.moves = np.concatenate((self.moves, self.rng.uniform(size=n) < self.wrong.moving))
        self.noise = np.vstack((self.noise, np.full((n, 4), np.nan)))
        self.offset = np.vstack((self.offset, np.zeros((n, 2))))
        self.next_id += n


def filter_of(config: Config, precision: Precision) -> Filter:
    """Returns a filter with the calibration."""
    told = Calibration(FX, FX, CX, CY, BASELINE_M, R_CB, T_CB)
    settings = {"slots": 40, "pixel-sigma": PIXEL_SIGMA} | config
    return Filter(told, settings, precision=precision)


def compared(filter: Filter, R: Floats, p: Floats) -> tuple[float, Floats, Floats]:
    """Returns NEES, error and sigmas of the pose against the true one."""
    R_found, p_found = filter.pose()
    P = filter.pose_covariance()
    e = screw(R_found.T @ R, R_found.T @ (p - p_found))
    return float(e @ np.linalg.solve(P, e)), e, np.sqrt(np.diag(P))


def frame(
    filter: Filter, camera: Camera, t_ns: int, R: Floats, p: Floats, twist: Floats
) -> tuple[float, Floats, Floats, bool]:
    """Gives the filter what the camera sees; returns `compared`, and whether it is GOOD."""
    ids, pixels = camera.look(R, p, twist)
    report = filter.update(t_ns, observations(ids, pixels))
    return *compared(filter, R, p), report.health == GOOD


def drive(seed: int, seconds: float, wrong: Wrong, config: Config, precision: Precision) -> Outcome:
    """Returns one run, as an Outcome of one row."""
    rng = np.random.default_rng([20, seed])
    steps = round(seconds / STEP_S)
    true = twists(rng, steps)
    bias = BIAS_SIGMA * rng.normal(size=6)
    walk = np.sqrt(BIAS_WALK * STEP_S) * rng.normal(size=(steps, 6))
    noise = np.repeat([VELOCITY_SIGMA, GYRO_SIGMA], 3) * rng.normal(size=(steps, 6))
    read = true + bias + np.cumsum(walk, axis=0) + noise
    turns, screws = turned(true[:, 3:] * STEP_S)
    filter = filter_of(config, precision)
    R, p = turned(np.array([0.1, -0.2, 0.7]))[0], np.array([3.0, -2.0, 1.0])
    filter.set_pose(0, R, p)
    camera = Camera(rng, wrong)
    rows = []
    for k in range(steps):
        t_ns = round(k * STEP_S * 1e9)
        filter.predict(t_ns, read[k, :3], read[k, 3:])
        if k % FRAME_STEPS == 0:
            rows.append(frame(filter, camera, t_ns, R, p, true[k]))
        way = R @ screws[k] @ (true[k, :3] * STEP_S)
        camera.move(way)
        R, p = R @ turns[k], p + way
    return Outcome(*(np.array(column)[None] for column in zip(*rows[1:], strict=True)))


def flight(
    seed: int, seconds: float, wrong: Wrong, config: Config, precision: Precision
) -> Outcome:
    """Returns one run by a raw IMU, whose start is known but for what is drawn."""
    rng = np.random.default_rng([21, seed])
    steps, h = round(seconds / IMU_S), IMU_S
    t = (np.arange(steps + 2) - 0.5) * h  # a reading stands for the time from t[k] to t[k + 1]
    hertz, phase = rng.uniform(0.05, 0.4, (2, 3)), rng.uniform(0, 2 * np.pi, (2, 3))
    waves = np.sin(2 * np.pi * hertz * t[:, None, None] + phase)
    p = np.array([1.5, 1.5, 0.4]) * waves[:, 0] + np.outer(t, [0.7, 0.2, 0])
    angles = np.array([0.15, 0.15, 0.8]) * waves[:, 1]
    R = (
        turned(angles * [0, 0, 1])[0]
        @ turned(angles * [0, 1, 0])[0]
        @ turned(angles * [1, 0, 0])[0]
    )
    v = np.gradient(p, h, axis=0)
    rate = np.array([screw(A.T @ B, np.zeros(3))[3:] for A, B in pairwise(R)]) / h
    middle = R[:-1] @ turned(rate * h / 2)[0]
    force = np.einsum("nji,nj->ni", middle, np.diff(v, axis=0) / h - GRAVITY_W)
    bias = IMU_BIAS_SIGMA * rng.normal(size=6)
    walk = np.cumsum(IMU_WALK * np.sqrt(h) * rng.normal(size=(steps + 1, 6)), axis=0)
    read = np.hstack((force, rate)) + bias + walk
    read += IMU_NOISE / np.sqrt(h) * rng.normal(size=read.shape)
    by_imu: Config = {"process": "imu", "imu-timing": "mid"}
    filter = filter_of(by_imu | config, precision)
    at_reading = middle, (p[:-1] + p[1:]) / 2, (v[:-1] + v[1:]) / 2
    R0, p0, v0 = (quantity[0] for quantity in at_reading)
    spread = START_SIGMA * rng.normal(size=9)
    turn, V = turned(spread[3:6])
    filter.set_pose(0, R0 @ turn, p0 + R0 @ V @ spread[:3], np.diag(START_SIGMA[:6] ** 2))
    filter.set_bias(np.zeros(6), IMU_BIAS_SIGMA**2)
    filter.set_velocity(turn.T @ (R0.T @ v0) + spread[6:], START_SIGMA[6:] ** 2)
    camera = Camera(rng, wrong)
    rows = []
    for k in range(steps):
        t_ns = round(k * h * 1e9)
        filter.inertial(t_ns, read[k, :3], read[k, 3:])
        if k % IMU_PER_FRAME == 0:
            R, p = at_reading[0][k], at_reading[1][k]
            rows.append(frame(filter, camera, t_ns, R, p, np.zeros(6)))
    return Outcome(*(np.array(column)[None] for column in zip(*rows[1:], strict=True)))


def driven(
    runs: int,
    seconds: float,
    wrong: Wrong,
    config: Config,
    precision: Precision = "float32",
    run: Callable[[int, float, Wrong, Config, Precision], Outcome] = drive,
) -> Outcome:
    """Returns all runs."""
    all_of_them = [run(seed, seconds, wrong, config, precision) for seed in range(runs)]
    parts = zip(*(vars(one).values() for one in all_of_them), strict=True)
    return Outcome(*(np.concatenate(part) for part in parts))


def honest(runs: int, seconds: float, config: Config, precision: Precision, by_imu: bool) -> bool:
    """Prints NEES/6 at the checkpoints; returns whether each is within its bounds."""
    run = flight if by_imu else drive
    outcome = driven(runs, seconds, Wrong(drawn=True), config, precision, run)
    last = outcome.nees.shape[1]
    checkpoints = np.linspace(last / 8, last, 8).astype(int) - 1
    outside = 0.001 / len(checkpoints) / 2
    low, high = chi2.ppf([outside, 1 - outside], 6 * runs) / (6 * runs)
    print(f"{runs} runs of {seconds:g} s, {precision}: NEES/6 is within {low:.2f} and {high:.2f}")
    means = outcome.nees[:, checkpoints].mean(axis=0) / 6
    for k, mean in zip(checkpoints, means, strict=True):
        error = np.sqrt((outcome.error[:, k, :3] ** 2).sum(axis=1).mean())
        own = np.sqrt((outcome.sigma[:, k, :3] ** 2).sum(axis=1).mean())
        at_s = (k + 1) * FRAME_STEPS * STEP_S
        inside = "" if low <= mean <= high else "   OUTSIDE"
        print(f"{at_s:5.1f} s  {mean:5.2f}   error {error:.3f} m, own sigma {own:.3f} m{inside}")
    good = outcome.good.mean()
    print(f"GOOD beyond 5 sigma: {outcome.silent():.4f} of the frames; GOOD: {good:.3f}")
    return bool(((low <= means) & (means <= high)).all())


CASES = {
    "nothing": Wrong(),
    "the camera is mounted 0.2 degrees askew": Wrong(askew_deg=0.2),
    "0.5 degrees": Wrong(askew_deg=0.5),
    "1 degree": Wrong(askew_deg=1.0),
    "pixel errors of a track have a correlation of 0.7": Wrong(correlation=0.7),
    "of 0.9": Wrong(correlation=0.9),
    "a tenth of the points move along": Wrong(moving=0.1),
    "tracks wander by 0.3 px/sqrt(s)": Wrong(wander=0.3),
    "by 1 px/sqrt(s)": Wrong(wander=1.0),
    "a rolling shutter of 10 ms": Wrong(shutter_s=0.01),
    "of 20 ms": Wrong(shutter_s=0.02),
}


def table(runs: int, seconds: float) -> None:
    """Prints the table in Markdown."""
    print("| what is wrong | camera exact | defaults | error, own sigma with defaults |")
    print("|---|---|---|---|")
    for name, wrong in CASES.items():
        exact, usual = (driven(runs, seconds, wrong, config) for config in (EXACT, {}))
        cells = [f"{one.silent():.2g}, {one.nees.mean() / 6:.2g}" for one in (exact, usual)]
        error, own = (
            np.sqrt((part[..., :3] ** 2).sum(axis=2).mean()) for part in (usual.error, usual.sigma)
        )
        print(f"| {name} | {cells[0]} | {cells[1]} | {error:.2f} m, {own:.2f} m |", flush=True)


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--float64", action="store_true")
    parser.add_argument("--imu", action="store_true")
    parser.add_argument("--told", action="append", default=[])
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    if given.table:
        table(given.runs or 32, given.seconds or 60)
        return 0
    config: Config = {}
    for name, _, value in (words.partition("=") for words in given.told):
        config[name] = float(value) if value[:1].isdigit() else value
    precision: Precision = "float64" if given.float64 else "float32"
    seconds = given.seconds or 24
    return 0 if honest(given.runs or 50, seconds, config, precision, given.imu) else 1


if __name__ == "__main__":
    sys.exit(main())
