# SPDX-License-Identifier: MIT
"""An IMU's noise and the correction of its readings, by a calibration.

    a = A a_m + a_0,    w = W w_m + G a + w_0

of the measured a_m, w_m: scales, axes that are not square, a gyro that feels forces, known biases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pelorus.io.named import Named
from pelorus.math.inertial import Inertial
from pelorus.wire.frames import Noise
from pelorus.wire.layout import Floats

NOISES = ("gyro_noise", "accel_noise", "gyro_walk", "accel_walk")


def noise(content: Named, keys: Sequence[str]) -> Noise:
    """Returns the densities that the file has under these keys, in the order of NOISES."""
    there = [(name, key) for name, key in zip(NOISES, keys, strict=True) if key in content]
    return Noise(**{name: content.number(key) for name, key in there})


@dataclass(frozen=True)
class Correction:
    """The matrices and offsets of accelerometer and gyro."""

    A: Floats = field(default_factory=lambda: np.eye(3))
    a_0: Floats = field(default_factory=lambda: np.zeros(3))
    W: Floats = field(default_factory=lambda: np.eye(3))
    G: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    w_0: Floats = field(default_factory=lambda: np.zeros(3))

    def of(self, readings: Inertial) -> Inertial:
        a = readings.a_B_mps2 @ self.A.T + self.a_0
        w = readings.w_B_radps @ self.W.T + a @ self.G.T + self.w_0
        return Inertial(readings.t_ns, a, w)

    @property
    def is_none(self) -> bool:
        same = Correction()
        return all(np.array_equal(getattr(self, k), getattr(same, k)) for k in vars(same))


@dataclass(frozen=True)
class ImuModel:
    """Noise and correction; `remarks` say which parts of the file are applied."""

    noise: Noise = field(default_factory=Noise)
    correction: Correction = field(default_factory=Correction)
    remarks: tuple[str, ...] = ()
