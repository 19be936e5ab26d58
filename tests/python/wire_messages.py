# SPDX-License-Identifier: MIT
# ruff: noqa: D103  (one maker a kind)
"""Seeded random messages of every kind but END, with fields at the ends of their ranges."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pelorus.wire import frames, image
from pelorus.wire.frames import Message

EXTREMES = np.array(
    [np.nan, np.inf, -np.inf, 1.7976931348623157e308, -2.2e-308, 5e-324, -0.0, 0.0, 0.1, -1e17]
)
EXTREMES_F32 = np.array(
    [np.nan, np.inf, -np.inf, 3.4028235e38, -1.2e-38, 1e-45, -0.0, 0.0, 0.1, -1e17], np.float32
)


REPORT_COUNTS = (
    *("budget", "observations", "matched", "used", "gated", "created", "evicted"),
    *("refused", "duplicates", "no_room", "poor", "left_out", "blocks_failed", "active", "nis_dof"),
)


def reals(random: np.random.Generator, *shape: int) -> Any:
    """Plain numbers, with one in five an extreme."""
    plain = random.normal(scale=100, size=shape)
    return np.where(random.random(shape) < 0.2, random.choice(EXTREMES, shape), plain)


def narrow_reals(random: np.random.Generator, *shape: int) -> Any:
    plain = random.normal(scale=100, size=shape).astype(np.float32)
    return np.where(random.random(shape) < 0.2, random.choice(EXTREMES_F32, shape), plain)


def whole(random: np.random.Generator, bits: int) -> int:
    """A number of so many bits: small, large, or one of the ends."""
    top = (1 << bits) - 1
    some = int(random.integers(0, top, dtype=np.uint64))
    return (0, 1, top, top - 1, some)[random.integers(5)]


def a_text(random: np.random.Generator, most: int) -> str:
    """Characters of one to four bytes, at most so many bytes of them."""
    characters = random.choice(list("aZ é€😀"), int(random.integers(0, most // 4 + 1)))
    return "".join(characters)


def a_header(random: np.random.Generator) -> Message:
    return frames.Header(
        camera=frames.Camera(*reals(random, 5)),
        R_CB=reals(random, 3, 3),
        t_CB_m=reals(random, 3),
        body_axes=frames.BodyAxes(int(random.integers(3))),
        twist_timing=frames.TwistTiming(int(random.integers(3))),
        image_width_px=whole(random, 16),
        image_height_px=whole(random, 16),
        noise=frames.Noise(*reals(random, 19)),
        process=frames.Process(int(random.integers(2))),
        name=a_text(random, frames.NAME_BYTES_MAX),
    )


def a_config(random: np.random.Generator) -> Message:
    count = int(random.integers(65))
    numbers = random.permutation(256)[:count]
    return frames.Config(
        settings={int(i): float(x) for i, x in zip(numbers, reals(random, count), strict=True)},
        build_fingerprint=whole(random, 32),
        max_landmarks=whole(random, 16),
        max_observations=whole(random, 16),
        block_observations=whole(random, 8),
        real_bytes=whole(random, 8),
    )


def a_start(random: np.random.Generator) -> Message:
    return frames.Start(
        t_ns=whole(random, 64),
        R_WB=reals(random, 3, 3),
        p_WB_m=reals(random, 3),
        flags=frames.StartFlag(int(random.integers(4))),
        covariance=reals(random, 21),
        bias_mean=reals(random, 6),
        bias_variance=reals(random, 6),
        velocity=reals(random, 3),
        velocity_variance=reals(random, 3),
    )


def a_twist(random: np.random.Generator) -> Message:
    return frames.Twist(whole(random, 64), reals(random, 3), reals(random, 3))


def a_stereo(random: np.random.Generator) -> Message:
    count = int(random.choice([0, 1, 13, 200]))
    ids = random.integers(0, 1 << 32, count, dtype=np.uint32)
    return frames.Stereo(whole(random, 64), ids, narrow_reals(random, count, 4), whole(random, 16))


def a_truth(random: np.random.Generator) -> Message:
    return frames.Truth(
        t_ns=whole(random, 64),
        R_WB=reals(random, 3, 3),
        p_WB_m=reals(random, 3),
        knows=frames.TruthKnows(int(random.integers(4))),
        velocity=reals(random, 3),
        bias=reals(random, 6),
    )


def a_landmark(random: np.random.Generator) -> Message:
    return frames.Landmark(
        id=whole(random, 32),
        p_W_m=reals(random, 3),
        covariance=reals(random, 6),
        role=frames.Role(int(random.integers(3))),
        t_ns=whole(random, 64),
        times_seen=whole(random, 32),
    )


def a_pose(random: np.random.Generator) -> Message:
    real_bytes = int(random.choice([4, 8]))
    some = narrow_reals if real_bytes == 4 else reals
    return frames.Pose(
        t_ns=whole(random, 64),
        p_WB_m=reals(random, 3),
        R_WB=some(random, 3, 3),
        covariance=some(random, 21),
        v_B_mps=some(random, 3),
        w_B_radps=some(random, 3),
        bias=some(random, 6),
        velocity_covariance=some(random, 21),
        real_bytes=real_bytes,
        after_stereo=bool(random.integers(2)),
        reset_count=whole(random, 16),
        trace=float(reals(random)),
        bias_variance=narrow_reals(random, 6),
    )


def a_report(random: np.random.Generator) -> Message:
    report = frames.Report(
        t_ns=whole(random, 64),
        subject=whole(random, 8),
        status=-int(random.choice([0, 1, 17, 128])),
        health=int(random.integers(4)),
        nis=float(narrow_reals(random)),
        innovation_rows=whole(random, 16),
        innovation_d2=float(narrow_reals(random)),
        innovation_log_det=float(narrow_reals(random)),
        update_us=whole(random, 32),
        reasons=whole(random, 32),
        notice=whole(random, 8),
    )
    return replace(report, **{name: whole(random, 16) for name in REPORT_COUNTS})


def a_remark(random: np.random.Generator) -> Message:
    return frames.Text(a_text(random, frames.TEXT_BYTES_MAX), int(random.integers(3)))


def a_state(random: np.random.Generator) -> Message:
    action = frames.StateAction(int(random.integers(1, 3)))
    return frames.State(whole(random, 64), action, reals(random, 6))


def a_reading(random: np.random.Generator) -> Message:
    return frames.Reading(
        t_ns=whole(random, 64),
        sensor=whole(random, 8),
        axes=whole(random, 8),
        value=reals(random, 3),
        sigma=narrow_reals(random, 3),
        at_B_m=narrow_reals(random, 3),
    )


def an_imu(random: np.random.Generator) -> Message:
    count = int(random.choice([1, 2, frames.IMU_READINGS_MAX]))
    return frames.Imu(
        t_ns=whole(random, 64),
        a_B_mps2=narrow_reals(random, count, 3),
        w_B_radps=narrow_reals(random, count, 3),
        period_ns=whole(random, 32),
    )


def an_image(random: np.random.Generator) -> Message:
    count = int(random.choice([1, 160, image.BAND_PIXELS]))
    pixels = random.integers(0, 256, count, dtype=np.uint8)
    side = image.Side(int(random.integers(2)))
    size = whole(random, 16), whole(random, 16)
    return image.Image(whole(random, 64), side, *size, whole(random, 32), pixels)


def a_rig(random: np.random.Generator) -> Message:
    lenses: list[Any] = []
    for _ in range(2):
        lenses += [int(random.integers(3)), *reals(random, 4).tolist()]
    rest = (reals(random, 8), reals(random, 8), reals(random, 3, 3), reals(random, 3))
    ends = (float(reals(random)), whole(random, 16), whole(random, 16))
    values: list[Any] = [whole(random, 16), whole(random, 16), *lenses, *rest, *ends]
    return image.RigMessage(*values)


MAKERS = [
    a_header,
    a_config,
    a_start,
    a_twist,
    a_stereo,
    a_truth,
    a_landmark,
    a_pose,
    a_report,
    a_remark,
    a_state,
    a_reading,
    an_imu,
    an_image,
    a_rig,
]


def messages_of(seed: int, rounds: int) -> list[Message]:
    random = np.random.default_rng(seed)
    return [maker(random) for _ in range(rounds) for maker in MAKERS]
