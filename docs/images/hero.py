#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Draws docs/images/hero.webp, the moving picture of README: pictures are rendered (street.py),
points are followed by the library's eyes, and the filter finds the way from them and odometry.

usage: PYTHONPATH=tools hero.py [FILE.webp]

The rendered pictures are kept in build/hero: some five minutes, once.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import street
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from numpy.typing import NDArray
from pelorus import Calibration, Filter, KnownLandmark, observations
from pelorus.eyes.front_end import Eyes, Shown, track
from pelorus.io.tracks import Tracks
from PIL import Image
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "build/hero"
SPEED_MPS, RATE_HZ, TWISTS_PER_FRAME = 3.0, 10, 5
HALF_LONG_M, HALF_WIDE_M, CORNER_M, HEIGHT_M = 8.6, 5.6, 2.8, 1.2
VELOCITY_SIGMA, GYRO_SIGMA = 0.3, 0.05  # m/s, rad/s
BIAS_V, BIAS_W = (0.06, 0.02, -0.01), (0.002, -0.003, 0.025)
R_CB = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # body: forward, left, up
CONFIG = {
    "slots": 80, "pixel-sigma": 0.5, "velocity-sigma": VELOCITY_SIGMA, "gyro-sigma": GYRO_SIGMA,
    "bias-velocity-sigma": 0.05, "bias-gyro-sigma": 0.02, "twist-timing": "start",
    "focal-sigma": 0.0, "baseline-sigma": 0.0, "camera-turn-sigma": 0.0,
}  # fmt: skip
INK, OURS, ODOMETRY = "#1b2733", "#1565c0", "#c62828"
SHOWN_EVERY, TAIL = 2, 5


# --- the drive ------------------------------------------------------------------------------------


def way(s: float) -> tuple[float, float, float]:
    """x, y, heading after s metres, counter-clockwise, from the middle of a long side."""
    straights = 2 * (HALF_LONG_M - CORNER_M), 2 * (HALF_WIDE_M - CORNER_M)
    x, y, yaw, s = 0.0, -HALF_WIDE_M, 0.0, s % lap()
    for length in (straights[0] / 2, straights[1], straights[0], straights[1], straights[0] / 2):
        step = min(s, length)
        x, y, s = x + step * np.cos(yaw), y + step * np.sin(yaw), s - step
        if s <= 0:
            break
        turn = min(s / CORNER_M, np.pi / 2)
        x += CORNER_M * (np.sin(yaw + turn) - np.sin(yaw))
        y -= CORNER_M * (np.cos(yaw + turn) - np.cos(yaw))
        yaw, s = yaw + turn, s - turn * CORNER_M
        if s <= 0:
            break
    return x, y, yaw


def lap() -> float:
    """Its length, m."""
    return 4 * (HALF_LONG_M + HALF_WIDE_M - 2 * CORNER_M) + 2 * np.pi * CORNER_M


FRAMES = round(lap() / SPEED_MPS * RATE_HZ)


def body(t_s: float) -> tuple[Floats, Floats]:
    """R_WB, p_WB: it nods a little."""
    x, y, yaw = way(t_s * SPEED_MPS)
    nod, sway = 0.012 * np.sin(9.0 * t_s), 0.010 * np.sin(6.1 * t_s + 1)
    R = Rotation.from_euler("ZYX", (yaw, nod, sway)).as_matrix()
    return R, np.array([x, y, HEIGHT_M + 0.015 * np.sin(9.0 * t_s + 0.5)])


def eyes_of(t_s: float, side: int, shutter_s: float) -> tuple[Floats, Floats]:
    """R_WC, p_WC of the left or right camera; of each rendered row, if they are read in succession."""
    rows = street.HEIGHT * street.OVERSAMPLED
    late = np.linspace(-0.5, 0.5, rows) * shutter_s if shutter_s else np.zeros(1)
    bodies = [body(t_s + float(dt)) for dt in late]
    R = np.array([R_WB @ R_CB.T for R_WB, _ in bodies])
    p = np.array([p_WB for _, p_WB in bodies]) + side * street.BASELINE_M * R[..., 0]
    return (R, p) if shutter_s else (R[0], p[0])


def rendered(kept: Path = KEPT, shutter_s: float = 0) -> list[tuple[Pixels, Pixels]]:
    """Left and right, in colour; a rolling shutter's middle row is of the frame's time."""
    kept.mkdir(parents=True, exist_ok=True)
    scene = None
    pairs = []
    for k in range(FRAMES):
        pair = []
        for side, name in enumerate(("left", "right")):
            file = kept / f"{name}-{k:03}.png"
            if not file.exists():
                scene = scene or street.Street()
                rng = np.random.default_rng([k, side])
                picture = scene.picture(*eyes_of(k / RATE_HZ, side, shutter_s), rng)
                Image.fromarray(picture).save(file)
                print(f"\rrendered {k + 1} of {FRAMES}", end="", flush=True)
            pair.append(np.asarray(Image.open(file)))
        pairs.append((pair[0], pair[1]))
    return pairs


def gray(picture: Pixels) -> Pixels:
    """As the tracker wants it."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), np.uint8)


def followed(pairs: list[tuple[Pixels, Pixels]]) -> Tracks:
    """Points as `pelorus track` follows them."""
    timed = [Shown(k * 10**9 // RATE_HZ, *pair) for k, pair in enumerate(pairs)]
    return track(timed, Eyes(None, (street.WIDTH, street.HEIGHT)), (KEPT, KEPT))


# --- the filter -----------------------------------------------------------------------------------


@dataclass
class Run:
    """What is drawn of each frame."""

    p: Floats  # (frames, 3), estimated
    P: Floats  # (frames, 3, 3), of it, in the world
    odometry: Floats  # (frames, 3)
    truth: Floats
    landmarks: list[Floats]  # (n, 2) on the map
    ellipses: list[Floats]  # (n, 2, 2)
    left_behind: list[Floats]  # those that left the state


def twists(seed: int) -> list[list[tuple[int, Floats, Floats]]]:
    """Time in ns, v and w of each step before each frame, with noise and biases."""
    rng = np.random.default_rng(seed)
    frames: list[list[tuple[int, Floats, Floats]]] = []
    for k in range(FRAMES):
        frames.append([])
        for i in range(TWISTS_PER_FRAME if k else 0):
            begin, step = (k - 1 + i / TWISTS_PER_FRAME) / RATE_HZ, 1 / RATE_HZ / TWISTS_PER_FRAME
            (R0, p0), (R1, p1) = body(begin), body(begin + step)
            w = Rotation.from_matrix(R0.T @ R1).as_rotvec() / step
            v = Rotation.from_rotvec(w * step / 2).as_matrix().T @ R0.T @ (p1 - p0) / step
            v = v + BIAS_V + rng.normal(0, VELOCITY_SIGMA, 3)
            w = w + BIAS_W + rng.normal(0, GYRO_SIGMA, 3)
            frames[-1].append((round(begin * 1e9), v, w))
    return frames


def camera() -> Calibration:
    """The rendered pair."""
    cx, cy = (street.WIDTH - 1) / 2, (street.HEIGHT - 1) / 2
    return Calibration(street.FOCAL, street.FOCAL, cx, cy, street.BASELINE_M, R_CB)


def drive(tracks: Tracks, seed: int = 3) -> Run:
    """The filter's way, and that of the odometry alone."""
    filter = Filter(camera(), CONFIG)
    alone = Filter(camera(), CONFIG | {"mode": "dead_reckoning"})
    for one in (filter, alone):
        one.set_pose(0, *body(0.0))
    bounds = tracks.bounds()
    rows = []
    for k, steps in enumerate(twists(seed)):
        t_ns = k * 10**9 // RATE_HZ
        for one in (filter, alone):
            for step in steps:
                one.predict(*step)
        now = slice(int(bounds[k]), int(bounds[k + 1]))
        filter.update(t_ns, observations(tracks.id[now], tracks.pixels[now]))
        alone.update(t_ns, observations([], np.empty((0, 4))))
        R, p = filter.pose()
        held = filter.landmarks()
        gone = [
            np.asarray(one.p_W_m)[:2]
            for one in filter.evicted.values()
            if isinstance(one, KnownLandmark)
        ]
        rows.append(
            (
                p, R @ filter.pose_covariance()[:3, :3] @ R.T, alone.pose().p, body(k / RATE_HZ)[1],
                held["p_W_m"][:, :2], held["P_W_m2"][:, :2, :2], np.array(gone).reshape(-1, 2),
            )
        )  # fmt: skip
    p, P, odometry, truth, landmarks, ellipses, gone = zip(*rows, strict=True)
    return Run(*map(np.array, (p, P, odometry, truth)), list(landmarks), list(ellipses), list(gone))


# --- the picture ----------------------------------------------------------------------------------


def with_tracks(picture: Pixels, tracks: Tracks, k: int) -> Pixels:
    """Each track with its way through the last frames, warm near and cold far."""
    scale = 2
    big = np.ascontiguousarray(
        cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    )
    bounds = tracks.bounds()
    recent = slice(int(bounds[max(k - TAIL, 0)]), int(bounds[k + 1]))
    ids, pixels = tracks.id[recent], tracks.pixels[recent]
    for row in range(int(bounds[k]), int(bounds[k + 1])):
        u, _, right, _ = tracks.pixels[row]
        warm = np.uint8(255 * np.clip((u - right) / 22, 0, 1))
        blue, green, red = (
            int(c) for c in cv2.applyColorMap(np.array([[warm]]), cv2.COLORMAP_TURBO)[0, 0]
        )
        tail = np.round((pixels[ids == tracks.id[row], :2] + 0.5) * scale).astype(np.int32)
        cv2.polylines(big, [tail.reshape(-1, 1, 2)], False, (red, green, blue), 2, cv2.LINE_AA)
        cv2.circle(big, tail[-1].tolist(), 5, (red, green, blue), -1, cv2.LINE_AA)
    return big


def ellipse(axes: Axes, centres: Floats, P: Floats, **style: str | float) -> None:
    """Three sigma."""
    values, vectors = np.linalg.eigh(P)
    sizes = 6 * np.sqrt(np.maximum(values, 0))
    angle = np.degrees(np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]))
    axes.add_collection(
        EllipseCollection(
            sizes[:, 1], sizes[:, 0], angle, units="xy", offsets=centres,
            offset_transform=axes.transData, **style,
        )
    )  # fmt: skip


def map_of(axes: Axes, run: Run, k: int, scene: list[street.Box]) -> None:
    """From above, up to frame k."""
    for box in scene:
        if box.low[2] == 0:
            wide, deep, _ = box.high - box.low
            axes.add_patch(plt.Rectangle(box.low[:2], wide, deep, color="#eceff1", zorder=0))
    axes.plot(*run.left_behind[k].T, ".", color="#90a4ae", markersize=1.6, zorder=1)
    ellipse(
        axes,
        run.landmarks[k],
        run.ellipses[k],
        facecolor="#43a04766",
        edgecolor="#2e7d32",
        linewidth=0.6,
    )
    axes.plot(*run.odometry[: k + 1, :2].T, color=ODOMETRY, linewidth=1.2)
    axes.plot(*run.truth[: k + 1, :2].T, color=INK, linewidth=2.6, alpha=0.35)
    axes.plot(*run.p[: k + 1, :2].T, color=OURS, linewidth=1.4)
    ellipse(
        axes,
        run.p[k : k + 1, :2],
        run.P[k : k + 1, :2, :2],
        facecolor="#1565c055",
        edgecolor=OURS,
        linewidth=1,
    )
    axes.plot(*run.p[k, :2], "o", color=OURS, markersize=4)
    axes.set(xlim=(-13.8, 13.8), ylim=(-13.6, 11.0), aspect="equal")
    axes.axis("off")
    lines = (
        ("odometry alone", ODOMETRY),
        ("Pelorus", OURS),
        ("landmarks, 3 sigma", "#2e7d32"),
        ("truth", "#8d959c"),
    )
    for place, (name, colour) in enumerate(lines):
        at = (0.02 + 0.44 * (place % 2), 0.055 - 0.055 * (place // 2))
        axes.text(*at, name, color=colour, fontsize=8.5, weight="bold", transform=axes.transAxes)


def band_of(axes: Axes, run: Run, k: int) -> None:
    """The error of y in its 3-sigma band."""
    t = np.arange(FRAMES) / RATE_HZ
    error, sigma = 100 * (run.p - run.truth)[:, 1], 100 * np.sqrt(run.P[:, 1, 1])
    axes.fill_between(
        t[: k + 1], -3 * sigma[: k + 1], 3 * sigma[: k + 1], color="#bbdefb", linewidth=0
    )
    axes.plot(t[: k + 1], error[: k + 1], color=INK, linewidth=1.1)
    axes.set(xlim=(0, t[-1]), ylim=(-3.4 * sigma.max(), 3.4 * sigma.max()))
    axes.set_title("error of y in its 3-sigma band, cm", fontsize=8.5, loc="left", pad=3, color=INK)
    axes.tick_params(labelsize=7.5, colors=INK)
    axes.xaxis.set_major_formatter("{x:.0f} s")
    axes.spines[["top", "right"]].set_visible(False)


def drawn(
    picture: Pixels, tracks: Tracks, run: Run, k: int, scene: list[street.Box]
) -> Image.Image:
    """A frame of the moving picture."""
    figure = plt.figure(figsize=(9.6, 4.1), dpi=100, facecolor="white")
    axes = figure.add_axes((0.0, 0.229, 0.583, 0.771))
    axes.imshow(with_tracks(picture, tracks, k), aspect="auto")
    axes.axis("off")
    map_of(figure.add_axes((0.588, 0.0, 0.41, 1.0)), run, k, scene)
    band_of(figure.add_axes((0.04, 0.055, 0.535, 0.115)), run, k)
    figure.canvas.draw()
    shown = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy())  # type: ignore[attr-defined]
    plt.close(figure)
    return shown


def main() -> None:
    """Renders, tracks, filters, draws."""
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/images/hero.webp"
    pairs = rendered()
    tracks = followed([(gray(left), gray(right)) for left, right in pairs])
    run = drive(tracks)
    error, own = run.p[-1] - run.truth[-1], np.sqrt(np.diag(run.P[-1]))
    drift = np.linalg.norm(run.odometry[-1] - run.truth[-1])
    print(
        f"{lap():.0f} m in {FRAMES / RATE_HZ:.1f} s, {len(tracks.id) / FRAMES:.0f} tracks a frame"
    )
    print(f"at the end off by {error} m, 3 sigma {3 * own} m; odometry alone {drift:.2f} m")
    scene = street.block()
    shown = [drawn(pairs[k][0], tracks, run, k, scene) for k in range(0, FRAMES, SHOWN_EVERY)]
    first, *others = shown
    lasting = [SHOWN_EVERY * 1000 // RATE_HZ // 2] * (len(shown) - 1) + [2500]
    first.save(
        out, save_all=True, append_images=others, duration=lasting, loop=0, quality=38, method=6
    )
    print(f"{out}: {out.stat().st_size // 1024} KB")


if __name__ == "__main__":
    main()
