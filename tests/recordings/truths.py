# SPDX-License-Identifier: MIT
"""What the truths of recordings with a real IMU are worth: held against their own readings.

usage: truths.py [--only TEXT]

g, tilt      what falls, m/s^2, and how far it is from the truth's vertical, mrad about x and y:
             fitted to the truth's positions and the specific forces turned by its attitudes, over
             windows of 2 s, each with a place, a velocity and accelerometer biases of its own
clock        by which the truth is later than the gyro, ms
turn         RMS of what the truth turns beside the gyro (bias taken off) in 50 ms, an axis, mrad
residual     RMS of the truth's positions about the readings in these windows, an axis, mm; there
             the attitude is the gyro's, and each window's first one is fitted, too
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from judge import DATA, by_real_imu, converted
from pelorus.io.trajectory import truth_in
from pelorus.wire.frames import Imu, Message
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import Floats
from scipy.spatial.transform import Rotation, Slerp

WINDOW_S, FRAME_S = 2.0, 0.05
SHIFTS_S = np.arange(-8, 8.01, 0.25) * 1e-3


class Series(NamedTuple):
    """Readings at `t`, s, and the truth's poses at `at`."""

    t: Floats
    w: Floats
    a: Floats
    at: Floats
    turned: Rotation
    p: Floats


def series(messages: list[Message]) -> Series | None:
    """Returns the series of one recording; None without truth or readings."""
    readings = [m for m in messages if isinstance(m, Imu)]
    truth = truth_in(messages)
    if truth is None or not readings:
        return None
    t_ns = np.concatenate([m.times_ns for m in readings])
    begin = int(truth.t_ns[0])
    return Series(
        (t_ns - begin) * 1e-9,
        np.concatenate([m.w_B_radps for m in readings]).astype(float),
        np.concatenate([m.a_B_mps2 for m in readings]).astype(float),
        ((truth.t_ns - begin) * 1e-9).astype(float),
        Rotation.from_matrix(truth.poses.R),
        truth.poses.p,
    )


def reckoned(t: Floats, w: Floats) -> Slerp:
    """Returns attitudes by the gyro alone, from the first reading on."""
    turns = Rotation.from_rotvec((w[1:] + w[:-1]) / 2 * np.diff(t)[:, None])
    out = [Rotation.identity()]
    for turn in turns:
        out.append(out[-1] * turn)
    return Slerp(t, Rotation.concatenate(out))


def late_s(s: Series) -> tuple[float, Floats, float]:
    """Returns the delay of the truth's clock, s, the gyro's bias, and the RMS difference of turns.

    Turns of truth and gyro are compared from frame to frame.
    """
    gyro = reckoned(s.t, s.w)
    knots = np.arange(max(s.at[0], s.t[0]) + 0.1, min(s.at[-1], s.t[-1]) - 0.1, FRAME_S)
    true = Slerp(s.at, s.turned)(knots)
    turns = (true[:-1].inv() * true[1:]).as_rotvec()
    found = []
    for shift in SHIFTS_S:
        mine = gyro(knots - shift)
        off = (mine[:-1].inv() * mine[1:]).as_rotvec() - turns
        bias = np.median(off, axis=0)  # in a frame; a truth that jumps does not move it
        found.append((float(np.median(np.abs(off - bias))), float(shift), bias / FRAME_S))
    k = int(np.argmin([one[0] for one in found]))
    _, shift, bias = found[k]
    mine = gyro(knots - shift)
    off = (mine[:-1].inv() * mine[1:]).as_rotvec() - turns - bias * FRAME_S
    return shift, bias, float(np.sqrt(np.mean(off**2)))


def twice_summed(t: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Returns first and second integral by the trapezium rule, of rows (n, ...)."""
    dt = np.diff(t).reshape(-1, *([1] * (rows.ndim - 1)))
    once = np.concatenate((0 * rows[:1], np.cumsum((rows[1:] + rows[:-1]) / 2 * dt, axis=0)))
    change = once[:-1] * dt + (2 * rows[:-1] + rows[1:]) / 6 * dt**2
    return once, np.concatenate((0 * rows[:1], np.cumsum(change, axis=0)))


def windows(s: Series) -> list[tuple[Floats, Floats]]:
    """Returns masks of readings and truths of each window in which both are complete."""
    out = []
    for begin in np.arange(max(s.t[0], s.at[0]), min(s.t[-1], s.at[-1]) - WINDOW_S, WINDOW_S):
        readings = (s.t >= begin) & (s.t <= begin + WINDOW_S)
        truths = (s.at >= s.t[readings][0]) & (s.at <= s.t[readings][-1])
        if truths.sum() > 20 and np.diff(s.t[readings]).max() < 0.02:
            out.append((readings, truths))
    return out


def at_truths(t: Floats, rows: Floats, at: Floats) -> Floats:
    """Returns rows (n, ...) interpolated at other times."""
    flat = rows.reshape(len(rows), -1)
    out = np.stack([np.interp(at, t, column) for column in flat.T], axis=-1)
    return out.reshape(len(at), *rows.shape[1:])


def design(t: Floats, turned: Rotation, a: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """Returns positions by the readings (n, 3), and their derivatives by the unknowns.

    These are a place, a velocity and biases of a window (n, 3, 9), and g (n,).
    """
    R = turned.as_matrix()
    _, way = twice_summed(t, np.einsum("nij,nj->ni", R, a))
    _, of_bias = twice_summed(t, -R)
    since = at - t[0]
    eye = np.broadcast_to(np.eye(3), (len(at), 3, 3))
    columns = (eye, since[:, None, None] * eye, at_truths(t, of_bias, at))
    return at_truths(t, way, at), np.concatenate(columns, axis=2), since**2 / 2


def gravity(s: Series, late: float) -> Floats:
    """Returns g (3,) in the truth's world, fitted to all windows together."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    attitudes = Slerp(s.at + 1e-12, s.turned)
    for readings, truths in windows(s):
        t, at = s.t[readings], s.at[truths]
        turned = attitudes(np.clip(t + late, s.at[0] + 1e-9, s.at[-1]))
        way, own, of_g = design(t, turned, s.a[readings], np.clip(at - late, t[0], t[-1]))
        Q, _ = np.linalg.qr(own.reshape(-1, 9))
        G = np.kron(of_g[:, None], np.eye(3))
        G -= Q @ (Q.T @ G)
        y = (s.p[truths] - way).ravel()
        A, b = A + G.T @ G, b + G.T @ y
    return np.linalg.solve(A, b).astype(float)


def residual_m(s: Series, late: float, gyro_bias: Floats, g: Floats) -> float:
    """Returns the RMS of positions about the readings, an axis.

    The attitude is the gyro's, and the first one of a window is fitted.
    """
    attitudes = Slerp(s.at, s.turned)
    off = []
    for readings, truths in windows(s):
        t, at = s.t[readings], s.at[truths]
        since_first = reckoned(t, s.w[readings] - gyro_bias)(t)
        turned = attitudes(np.clip(t[0] + late, s.at[0], s.at[-1])) * since_first
        at = np.clip(at - late, t[0], t[-1])
        way, own, of_g = design(t, turned, s.a[readings], at)
        force = np.einsum("nij,nj->ni", turned.as_matrix(), s.a[readings])
        across = np.zeros((len(t), 3, 3))  # d(Exp(theta) f)/d theta = -[f]x
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            across[:, i, j], across[:, j, i] = force[:, k], -force[:, k]
        _, of_turn = twice_summed(t, across)
        own = np.concatenate((own, at_truths(t, of_turn, at)), axis=2).reshape(-1, 12)
        y = (s.p[truths] - way - of_g[:, None] * g).ravel()
        off.append(y - own @ np.linalg.lstsq(own, y, rcond=1e-9)[0])
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def main() -> None:
    """Prints a row for each recording."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="recordings whose name contains it")
    parser.add_argument(
        "--cache", type=Path, default=Path(tempfile.gettempdir()) / "pelorus-recordings"
    )
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    print("| recording | g, m/s^2 | tilt, mrad | clock, ms | turn, mrad | residual, mm |")
    print("|---|---|---|---|---|---|")
    for case in by_real_imu():
        there = given.only in case.name and (DATA / case.file).exists()
        if not there or case.options or "pictures" in case.name:
            continue
        name = case.name.removesuffix(", default")
        s = series(messages_of(converted(case, given.cache)))
        if s is None:
            print(f"| {name} | no truth | | | | |")
            continue
        late, bias, turn = late_s(s)
        g = gravity(s, late)
        size = float(np.linalg.norm(g))
        cells = [f"{size:.3f}", ", ".join(f"{x:.1f}" for x in 1e3 * g[:2] / size)]
        cells += [f"{1e3 * late:.2f}", f"{1e3 * turn:.2f}"]
        cells.append(f"{1e3 * residual_m(s, late, bias, g):.1f}")
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
