# SPDX-License-Identifier: MIT
"""Estimates the biases of a recording's twists where both halves of the drive agree on them.

Other errors that look like a bias for a while differ between the halves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pelorus.check.clock import seconds
from pelorus.check.options import Settings
from pelorus.check.outcome import PART, Bench
from pelorus.check.parameters import FRAMES_FEW, PAYS, TWIST, written
from pelorus.wire.layout import Floats
from pelorus.wire.schema import DEFAULTS

WIDE = {"bias": "on", "bias-velocity-sigma": "0.1", "bias-gyro-sigma": "0.03"}
PRIORS = {"bias-gyro-sigma": "rad/s", "bias-velocity-sigma": "m/s"}
SURE = 3.0  # sigmas by which the halves' common bias must differ from zero
ALLOWS = 2.0  # a bias of so many prior sigmas is allowed
ALIKE = 0.7  # cosine of the largest angle between the halves' biases


class CommonBias(NamedTuple):
    """The common bias of both halves over the measured axes.

    `size` is 0 where chance may have made it; `known` is the standard error of one axis.
    """

    size: float
    known: float


def biases_by_halves(
    bench: Bench, fixed: Settings, values: Mapping[str, float]
) -> tuple[dict[str, str], str]:
    """Returns the settings with bias priors, and what was found in words.

    A kind of bias (velocity or rate) is switched on if both halves agree on it and the drive is
    likelier with it. The prior is as wide as the bias found, not the likeliest one: the three axes
    share a prior, and one axis alone may have a bias. Where the halves show none, the prior is the
    size that the drive cannot exclude, and no wider than the default.
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


def gyro_bias_in_drift(
    bench: Bench, fixed: Settings, values: Mapping[str, float], shared_px: float = 0.0
) -> tuple[dict[str, str], str]:
    """Returns the settings with a gyro bias prior for tracks that drift, and what was found in
    words.

    Both halves of the drive must show the same gyro bias. Halves of few frames agree by chance when
    errors last for seconds.

    `shared_px` is the error that a bent picture gives all points from frame to frame. A bias that
    turns them by less may be that error, and is not switched on.

    Drifting tracks look like a constant velocity bias, so none is estimated here.
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


def _halves(bench: Bench, settings: Settings) -> dict[str, CommonBias]:
    """Returns the common bias by the name of its prior; axes that nothing measures have none."""
    ran = bench.run_all([{**settings, PART: part} for part in "01"], "biases of both halves")
    twists = bench.examined
    found = {}
    for name, axes, readings in (
        ("bias-gyro-sigma", slice(3, 6), twists.w_B_radps),
        ("bias-velocity-sigma", slice(0, 3), twists.v_B_mps),
    ):
        there = np.any(readings != 0, axis=0)
        told = [(half.bias[axes][there], half.bias_variance[axes][there]) for half in ran]
        found[name] = common_bias(*told[0], *told[1]) if there.any() else CommonBias(0.0, 0.0)
    return found


def common_bias(b0: Floats, var0: Floats, b1: Floats, var1: Floats) -> CommonBias:
    """Returns the common part of two biases with independent errors, from their product."""
    if not (min(var0.min(), var1.min()) > 0):
        return CommonBias(0.0, 0.0)
    known = float(np.sqrt(np.mean(1 / (1 / var0 + 1 / var1))))
    products = b0 * b1
    score = float(np.sum(products / np.sqrt(var0 * var1))) / np.sqrt(len(products))
    alike = float(np.sum(products)) / float(np.linalg.norm(b0) * np.linalg.norm(b1) + 1e-30)
    if score < SURE or alike < ALIKE:
        return CommonBias(0.0, known)
    return CommonBias(float(np.sqrt(np.mean(products))), known)
