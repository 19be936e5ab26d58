# SPDX-License-Identifier: MIT
"""Detects an IMU in other axes or units than the extrinsic and the HEADER say.

A matrix maps what the images show in body axes to the readings: M_w for the rates of turn, M_a for
the specific force; the identity is expected. Both are measured, and the simplest fault that
explains both is named: units and signs, the extrinsic's inverse, axes that are turned, mirrored or
swapped, for gyro and accelerometer together or for one of them, any rotation. Attitudes are the
images' own where the gyro is wrong, so that it does not spoil the force. What the drive does not
excite stays unknown, and is not reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.faults.fit import WITHIN, Design, Fit
from pelorus.faults.force import NO_BREAKS, by_images, force
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.seen import CameraMotion, Motions
from pelorus.io.recording import Recording
from pelorus.io.tracks import Indices
from pelorus.math import se3
from pelorus.math.axes import ways
from pelorus.math.inertial import Inertial
from pelorus.wire.layout import Floats

LIMIT = 50.0  # by which d^2, of 18 degrees of freedom, may exceed the least
UNFIT, UNFIT_SHARE = 300.0, 0.2  # above this, and this share of the given axes' d^2, none fits
DOUBT = 0.03  # further error of a matrix's entry, relative to its scale
FREE_SCALE = 0.25  # larger errors are units; smaller ones are judged as calibration
OFFSETS_S = np.arange(-10, 11) * 0.04
OFFSET_SURE = 0.05  # share of the cost that another offset must save
TURNS_SIGMAS, PART_LEAST = 6.0, 3.0
LEVER_M, BIAS_MPS2, MATRIX = 3.0, 1.0, 1e3
BLOCKS = 20
ROUNDS = 8
GRAVITY = 9.81
UNIT_NEAR = np.log(1.5)  # of the median force to gravity, in the right unit
TURN_UNITS = {
    1.0: "",
    np.pi / 180: "rates of turn are in degrees",
    180 / np.pi: "degrees were made of radians twice",
}
FORCE_UNITS = {
    1.0: "",
    GRAVITY: "specific forces are in g",
    GRAVITY * 1e-3: "specific forces are in thousandths of g",
    1e-3: "specific forces are in mm/s^2",
}


@dataclass(frozen=True)
class Matrix:
    """A measured matrix M, with the covariance of its nine numbers row by row.

    A second covariance covers the readings' noise, for each unit of the matrix that is assumed.
    """

    M: Floats
    covariance: Floats
    by_readings: Floats

    def held_against(self, N: Floats, free: bool = True) -> float:
        """Returns d^2 of the matrix N, at its best scale, plus the cost of the larger noise that it
        needs.

        Without that cost large noise would explain anything.
        """
        size = float(np.linalg.norm(N) / np.sqrt(3))
        doubt = self.by_readings + DOUBT**2 * np.eye(9)
        wide = self.covariance + size**2 * doubt
        known = np.linalg.inv(wide)
        wider = np.linalg.slogdet(wide)[1] - np.linalg.slogdet(self.covariance + doubt)[1]
        n, m = N.ravel(), self.M.ravel()
        scale = 1.0
        if free and n.any():  # zero has no scale
            scale = float(np.clip(n @ known @ m / (n @ known @ n), 1 - FREE_SCALE, 1 + FREE_SCALE))
        left = m - scale * n
        return float(left @ known @ left + max(wider, 0.0))

    @property
    def is_told(self) -> bool:
        """Returns whether M differs from zero; another drive's readings are unrelated."""
        m = self.M.ravel()
        return float(m @ np.linalg.solve(self.covariance, m)) > LIMIT


class MatrixFit(NamedTuple):
    """A fit, and which of its unknowns are the matrix."""

    fit: Fit
    matrix: Matrix


@dataclass(frozen=True)
class Explained:
    """The matrices that are expected with a fault."""

    name: str
    words: str
    of_turn: Floats
    of_force: Floats

    @property
    def F(self) -> Floats:
        """Returns the axes of the sensor that is wrong."""
        return self.of_turn if np.allclose(self.of_force, np.eye(3)) else self.of_force


@dataclass(frozen=True)
class Measured:
    """The measured matrices of the rates of turn and of the specific force."""

    turn: Matrix
    force: Matrix
    usual_force: float  # median of its size, in the given unit

    def held_against(self, why: Explained) -> float:
        """Returns d^2 of both matrices together."""
        return self.turn.held_against(why.of_turn) + self.force.held_against(why.of_force)


def measured(
    recording: Recording, seen: CameraMotion, body: ImuBody, breaks_s: Floats = NO_BREAKS
) -> Measured | None:
    """Measures both matrices, at the clock offset at which the turns fit best.

    None with too few data. A stretch begins at each of `breaks_s`.
    """
    t_ns = recording.frame_t_ns
    at_offsets = {0.0: _turn(body, seen, t_ns, 0.0)}
    at_offsets |= {float(s): _turn(body, seen, t_ns, float(s)) for s in OFFSETS_S}
    fits = {offset: fit for offset, fit in at_offsets.items() if fit is not None}
    if not fits:
        return None
    offset = min(fits, key=lambda s: fits[s].fit.cost)
    if 0.0 in fits and fits[0.0].fit.cost - fits[offset].fit.cost < OFFSET_SURE * 3:
        offset = 0.0
    turn_fit, turn = fits[offset]
    frame_s = body.frame_s(t_ns, offset)
    if turn.held_against(np.eye(3)) > 0.5 * LIMIT:
        turns = np.where(seen.usable[:, None], seen.rates[:, 3:] * seen.tau_s[:, None], 0.0)
        attitudes = by_images(body.readings, frame_s, turns)
    else:
        attitudes = body.attitudes
    told = [
        force(body.readings.at(half), attitudes[half], frame_s, breaks_s)
        for half in _halves(body.readings)
    ]
    stretches = told[0].of_stretches()
    arm = se3.skew(_turns_without_noise(body.mean_turns(t_ns, offset), turn_fit))
    X = np.stack(
        [
            np.concatenate((half.of_force.reshape(-1, 3, 9), half.of_bias, arm, stretches), axis=2)
            for half in told
        ]
    )
    good = seen.usable & np.isfinite(told[0].turn).all(axis=1) & np.isfinite(X).all(axis=(0, 2, 3))
    beside = [BIAS_MPS2] * 3 + [LEVER_M] * 3 + [100.0] * stretches.shape[2]
    one, other = X[:, good]  # of the readings, each with its own noise
    noise = np.sqrt(0.5) * (one - other)[:, :, :9]
    at = np.flatnonzero(good)
    fit = _fit(seen.rates[at, :3], one, other, noise, seen.variance[at, :3], beside, at)
    usual = float(np.median(np.linalg.norm(body.readings.a_B_mps2, axis=1)))
    return Measured(turn, fit.matrix, usual)


def _halves(readings: Inertial) -> list[NDArray[np.intp]]:
    """Returns the odd and the even readings: the same motion with independent noise."""
    ends = 0, len(readings.t_ns) - 1
    return [np.union1d(ends, np.arange(k, ends[1], 2)) for k in (0, 1)]


def _turns_without_noise(w: Floats, fit: Fit) -> Floats:
    """Returns the images' turns in the gyro's axes: a common error would look like a lever."""
    return np.asarray(w @ fit.x[:9].reshape(3, 3).T + fit.x[9:])


def _turn(
    body: ImuBody, seen: CameraMotion, frame_t_ns: np.ndarray, offset_s: float
) -> MatrixFit | None:
    """Fits the gyro's matrix, with instruments from the images.

    They are the other half of the points and the neighbouring frames, which are free of what a gyro
    reads without turning, be it noise or a motor. What they do not explain of the readings counts
    as noise.
    """
    w, beside = body.mean_turns(frame_t_ns, offset_s), seen.beside()[:, 3:]
    good = seen.usable & np.isfinite(np.hstack((w, beside))).all(axis=1)
    if good.sum() < 0.5 * seen.usable.sum():
        return None
    silent = _are_silent(seen.rates[good, 3:], w[good], beside[good])
    parts = [_rows(own, w, others, silent) for own, others in seen.pairs()]
    order = np.argsort(np.concatenate([part[-1] for part in parts]), kind="stable")
    y, X, Z, variance, at = (np.concatenate(rows)[order] for rows in zip(*parts, strict=True))
    return _fit(y, X, Z, (X - Z)[:, :, :9], variance, [1.0] * 3, at)


def _are_silent(y: Floats, w: Floats, beside: Floats) -> bool:
    """Returns whether the readings are unrelated to what the images show."""
    seen_to_turn = _together(y, beside)
    return seen_to_turn > max(
        TURNS_SIGMAS, PART_LEAST * _together(w, _predicted(w, _with_bias(beside)))
    )


def _with_bias(own: Floats) -> Floats:
    """Returns the rates with a column for the bias."""
    return np.hstack((own, np.ones((len(own), 1))))


def _rows(
    own: CameraMotion, w: Floats, others: list[Motions], silent: bool
) -> tuple[Floats, Floats, Floats, Floats, Indices]:
    """Returns y, X, Z, the variance and the frames. Unrelated readings count as 0."""
    instruments = np.hstack([other.rates[:, 3:] for other in others])
    at = np.flatnonzero(own.usable & np.isfinite(np.hstack((w, instruments))).all(axis=1))
    w, told = w[at], _with_bias(_within(instruments[at]))
    expected = w if silent else told @ np.linalg.lstsq(told, w, rcond=None)[0]
    return own.rates[at, 3:], _columns(w), _columns(expected), own.variance[at, 3:], at


def _within(x: Floats) -> Floats:
    """Limits the rates by quantiles, for half of the points may give leaps."""
    return np.asarray(np.clip(x, *np.quantile(x, WITHIN, axis=0)))


def _columns(w: Floats) -> Floats:
    """Returns (k, 3, 12), the columns of M row by row, and of a bias."""
    X = np.zeros((len(w), 3, 12))
    for i in range(3):
        X[:, i, 3 * i : 3 * i + 3] = w
        X[:, i, 9 + i] = 1
    return X


def _predicted(w: Floats, told: Floats) -> Floats:
    """Returns the rates as predicted by a fit in the other half of the drive."""
    half = len(w) // 2
    first, second = (np.linalg.lstsq(told[k], w[k], rcond=None)[0] for k in
                     (slice(half), slice(half, None)))  # fmt: skip
    return np.concatenate((told[:half] @ second, told[half:] @ first))


def _together(a: Floats, b: Floats) -> float:
    """Returns by how many standard errors two motions (k, 3) correlate."""
    product = np.sum((a - a.mean(axis=0)) * (b - b.mean(axis=0)), axis=1)
    sums = np.bincount(np.arange(len(product)) * BLOCKS // len(product), product)
    return float(np.sum(sums) / (np.sqrt(BLOCKS) * np.std(sums) + 1e-12))


def _fit(
    y: Floats,
    X: Floats,
    Z: Floats,
    noise: Floats,
    variance: Floats,
    beside: list[float],
    at: Indices,
) -> MatrixFit:
    """Fits a matrix with instruments.

    By their own noise, where the drive has no motion, least squares would find a zero matrix with a
    small standard error.
    """
    prior = np.diag(np.array([MATRIX] * 9 + beside) ** -2.0)
    fit = Fit(Design(y, X, Z, variance, prior, y, at), BLOCKS)
    by_readings = np.sum([fit.covariance_of(part)[:9, :9] for part in np.moveaxis(noise, 2, 0)], 0)
    return MatrixFit(fit, Matrix(fit.x[:9].reshape(3, 3), fit.covariance[:9, :9], by_readings))


# --- what explains it -----------------------------------------------------------------------------


def explained(found: Measured, R_CB: Floats) -> Explained | None:
    """Returns the simplest explanation that fits; None if nothing is wrong.

    `name` is "no-fit" if nothing fits, and "turned" for a rotation without a name, which is in
    `of_turn`.
    """
    none = Explained("", "", np.eye(3), np.eye(3))
    kinds = (_units, _Inverted(R_CB), _of_both, _of_one, _turned, _of_each, _scaled)
    likely = [none, *(min(kind(found), key=found.held_against) for kind in kinds)]
    apart = [found.held_against(kind) for kind in likely]
    least = min(apart)
    silent = apart[0] > least + LIMIT and not (found.turn.is_told and found.force.is_told)
    if silent or least > max(UNFIT, UNFIT_SHARE * apart[0]):
        return Explained("no-fit", "", found.turn.M, found.force.M)
    simplest = next(e for e, d2 in zip(likely, apart, strict=True) if d2 < least + LIMIT)
    return None if simplest is none else simplest


def _units(found: Measured) -> Iterator[Explained]:
    """Yields other units by the median force: in another unit gravity is another number."""
    none = np.eye(3)
    for (turn, of_turn), (force_, of_force) in product(TURN_UNITS.items(), FORCE_UNITS.items()):
        words = "; ".join(w for w in (of_turn, of_force) if w)
        is_gravity = abs(np.log(found.usual_force * force_ / GRAVITY)) < UNIT_NEAR
        if words and (is_gravity or not of_force):
            name = "unit-degrees" if of_turn else "unit-force"
            yield Explained(name, f"the IMU's {words}", turn * none, force_ * none)
    words = (
        "the specific force has the wrong sign: an IMU at rest reads +9.81 m/s^2 along the axis "
        "that points up"
    )
    yield Explained("gravity-sign", words, none, -none)


class _Inverted:
    """An extrinsic that is given inverted."""

    def __init__(self, R_CB: Floats) -> None:
        self.Q = R_CB.T @ R_CB.T

    def __call__(self, _: Measured) -> Iterator[Explained]:
        yield Explained("inverted", "", self.Q, self.Q)


def _of_both(_: Measured) -> Iterator[Explained]:
    """Yields explanations for both sensors: a turned or mirrored frame, and swapped columns."""
    for F in ways():
        yield Explained("axes", "gyro and accelerometer have", np.linalg.det(F) * F, F)
        yield Explained("axes", "gyro and accelerometer have", F, F)


def _of_one(_: Measured) -> Iterator[Explained]:
    none = np.eye(3)
    for F in ways():
        yield Explained("axes", "the gyro has", F, none)
        yield Explained("axes", "the accelerometer has", none, F)


def _of_each(found: Measured) -> Iterator[Explained]:
    turn = min(ways(), key=found.turn.held_against)
    of_force = min(ways(), key=found.force.held_against)
    yield Explained("axes", "gyro and accelerometer differ: the gyro has", turn, of_force)


def _scaled(found: Measured) -> Iterator[Explained]:
    """Yields explanations by any factor."""
    none = np.eye(3)
    of_turn, of_force = (float(np.trace(m.M)) / 3 for m in (found.turn, found.force))
    words = (
        f"the images show {of_turn:.3g} times the gyro's turns and {of_force:.3g} times the "
        "accelerometer's forces: units, baseline or focal length"
    )
    yield Explained("scale", words, of_turn * none, of_force * none)


def _turned(found: Measured) -> Iterator[Explained]:
    """Yields the rotation of both sensors that fits best."""
    for F in ways():
        if np.linalg.det(F) > 0:
            Q = _nearest(found, F)
            yield Explained("turned", "", Q, Q)


def _nearest(found: Measured, Q: Floats) -> Floats:
    """Returns the rotation that fits best, by Gauss-Newton from Q."""
    matrices = [found.turn, found.force]
    known = [np.linalg.inv(m.covariance + m.by_readings + DOUBT**2 * np.eye(9)) for m in matrices]
    for _ in range(ROUNDS):
        J = np.stack([(se3.skew(e) @ Q).ravel() for e in np.eye(3)], axis=1)
        H = sum(J.T @ W @ J for W in known) + 1e-9 * np.eye(3)
        g = sum(J.T @ W @ (m.M - Q).ravel() for W, m in zip(known, matrices, strict=True))
        step = np.clip(np.linalg.solve(H, g), -0.5, 0.5)
        Q = se3.exp(np.zeros(3), step).R @ Q
    return Q
