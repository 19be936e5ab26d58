# SPDX-License-Identifier: MIT
"""The biases of a recording's twists, as both halves of the drive tell them alike.

What else looks like a bias for a while does not stay the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pelorus.check.clock import seconds
from pelorus.check.options import Settings
from pelorus.check.outcome import PART, Bench
from pelorus.check.parameters import FRAMES_FEW, PAYS, TWIST, written
from pelorus.layout import Floats
from pelorus.schema import DEFAULTS

WIDE = {"bias": "on", "bias-velocity-sigma": "0.1", "bias-gyro-sigma": "0.03"}
PRIORS = {"bias-gyro-sigma": "rad/s", "bias-velocity-sigma": "m/s"}
SURE = 3.0  # sigmas that the common part of two halves' biases must be from zero
ALLOWS = 2.0  # sigmas of a prior
ALIKE = 0.7  # cosine of the angle between them


class Told(NamedTuple):
    """Of the axes that are measured: the size of their bias, 0 if chance may have made it, and to
    how much both halves together tell one.
    """

    size: float
    known: float


def told_by_halves(
    bench: Bench, fixed: Settings, values: Mapping[str, float]
) -> tuple[dict[str, str], str]:
    """Of each kind that both halves of the drive tell alike, if the drive is likelier with it.

    As wide as what they tell: of priors the likeliest may be narrower than the bias of the one axis
    that has one, for the three axes share it. Where they tell none there may be one that the drive
    cannot tell, so the prior is what it could not, and no wider than it is by default.
    """
    side = {**fixed, **WIDE, **written(values, TWIST)}
    halves = _halves(bench, side)
    said = []
    for name, unit in PRIORS.items():
        tried = [{**side, name: "0"}, {**side, name: f"{halves[name].size:.2g}"}]
        none, some = bench.run_all(tried, "biases")
        pays = halves[name].size > 0 and some.gain_over(none) > PAYS
        least = min(halves[name].known, DEFAULTS[name])
        side[name] = f"{halves[name].size if pays else least:.2g}"
        if pays:
            said.append(f"of the {name.split('-')[1]} readings of about {side[name]} {unit}")
    words = f"biases {' and '.join(said)}, in both halves alike"
    return (
        {**fixed, "bias": "on", **{k: side[k] for k in PRIORS}},
        words if said else "no bias that both halves of the drive agree on",
    )


def told_in_drift(
    bench: Bench, fixed: Settings, values: Mapping[str, float], shared_px: float = 0.0
) -> tuple[dict[str, str], str]:
    """Where tracks drift both halves of the drive must tell the same gyro bias, and a prior that
    allows it stays. Halves of few frames agree by chance, when errors last for seconds.

    `shared_px`: a picture that is bent so far moves points from frame to frame by up to so much,
    all along alike. A bias that turns them by less may be that, and is not switched on.

    Such tracks look like a bias of the velocity all along, so with them there is none of it to be
    told, and likelihood would find one.
    """
    name = "bias-gyro-sigma"
    if len(bench.examined.frame_t_ns) < 2 * FRAMES_FEW:
        return dict(fixed), f"halves of fewer than {FRAMES_FEW} frames tell no biases"
    size = _halves(bench, {**fixed, **WIDE, **written(values, TWIST)})[name].size
    if not size > 0:
        return dict(fixed), "no bias that both halves of the drive agree on"
    words = f"biases of the gyro readings of about {size:.2g} rad/s, in both halves alike"
    if fixed.get("bias", "on") == "off":
        turns_px = size * bench.header.camera.fx_px * seconds(bench.examined.frame_t_ns)
        if turns_px < shared_px:
            return dict(fixed), (
                f"{words}, or the rectification: it is off by {shared_px:.2g} px, and such a bias "
                f"turns points by {turns_px:.2g} px a frame"
            )
        return {**fixed, "bias": "on", "bias-velocity-sigma": "0", name: f"{size:.2g}"}, words
    if size > ALLOWS * float(fixed.get(name, DEFAULTS[name])):
        return {**fixed, name: f"{size:.2g}"}, words
    return dict(fixed), f"{words}, which its prior allows"


def _halves(bench: Bench, settings: Settings) -> dict[str, Told]:
    """By the name of its prior. An axis that nothing measures has none."""
    ran = bench.run_all([{**settings, PART: part} for part in "01"], "biases of both halves")
    twists = bench.examined
    found = {}
    for name, axes, readings in (
        ("bias-gyro-sigma", slice(3, 6), twists.w_B_radps),
        ("bias-velocity-sigma", slice(0, 3), twists.v_B_mps),
    ):
        there = np.any(readings != 0, axis=0)
        told = [(half.bias[axes][there], half.bias_variance[axes][there]) for half in ran]
        found[name] = common_bias(*told[0], *told[1]) if there.any() else Told(0.0, 0.0)
    return found


def common_bias(b0: Floats, var0: Floats, b1: Floats, var1: Floats) -> Told:
    """The errors of the two are independent: their products have no mean but the bias squared."""
    if not (min(var0.min(), var1.min()) > 0):
        return Told(0.0, 0.0)
    known = float(np.sqrt(np.mean(1 / (1 / var0 + 1 / var1))))
    products = b0 * b1
    score = float(np.sum(products / np.sqrt(var0 * var1))) / np.sqrt(len(products))
    alike = float(np.sum(products)) / float(np.linalg.norm(b0) * np.linalg.norm(b1) + 1e-30)
    if score < SURE or alike < ALIKE:
        return Told(0.0, known)
    return Told(float(np.sqrt(np.mean(products))), known)
