# SPDX-License-Identifier: MIT
"""Events that are injected into a recording's messages: what goes wrong, and when.

Each takes the messages, its begin, and a random generator; the size is drawn, so that no rule can
fit one number. All work on any recording, simulated or real.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from pelorus.wire.frames import Imu, Kind, Message, Stereo, Truth, Twist

S = 1_000_000_000
Messages = list[Message]
Chance = np.random.Generator
MOTION = (Kind.TWIST, Kind.IMU)
SURVIVE = 15  # points that a jump leaves in sight
JUMP_LEAST_S = 0.3
DATA = (*MOTION, Kind.STEREO, Kind.TRUTH, Kind.READING)


class Event(NamedTuple):
    """An event to inject.

    `causes` are the names of right ones; `wheels`: whether it needs twists; `settings` are for the
    replay.
    """

    name: str
    causes: tuple[str, ...]
    into: Callable[[Messages, int, Chance], Messages | None]
    wheels: bool | None = None  # twists alone, an IMU alone, either
    settings: tuple[tuple[str, ...], ...] = ()
    whole: bool = False  # it holds all along


def _each(
    messages: Iterable[Message], kinds: tuple[Kind, ...], change: Callable[[Any], Message | None]
) -> Messages:
    changed = (change(m) if m.kind in kinds else m for m in messages)
    return [m for m in changed if m is not None]


def slip(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes wheels slip, or slide, for some seconds."""
    factor = chance.choice([0.0, 0.3, 0.5, 1.6, 2.0]) + 0.05 * chance.random()
    until = t + round(chance.uniform(2, 5) * S)

    def change(m: Twist) -> Message:
        return replace(m, v_B_mps=factor * m.v_B_mps) if t <= m.t_ns < until else m

    return _each(messages, (Kind.TWIST,), change)


def dead_encoder(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes the velocity stick at zero, or at its last value, to the end."""
    at_zero = chance.random() < 0.5
    held: list[Twist] = []

    def change(m: Twist) -> Message:
        if m.t_ns < t:
            return m
        held.append(m)
        return replace(m, v_B_mps=np.zeros(3) if at_zero else held[0].v_B_mps)

    return _each(messages, (Kind.TWIST,), change)


def dead_gyro(messages: Messages, t: int, chance: Chance) -> Messages:  # noqa: ARG001
    """Makes the gyro read nothing, to the end."""

    def change(m: Any) -> Message:
        if m.t_ns < t:
            return m  # type: ignore[no-any-return]
        return replace(m, w_B_radps=np.zeros_like(m.w_B_radps))  # type: ignore[no-any-return]

    return _each(messages, MOTION, change)


def dead_axis(messages: Messages, t: int, chance: Chance) -> Messages:  # noqa: ARG001
    """Makes the gyro's axis that turns most stick at its last value, to the end."""
    readings = [m for m in messages if isinstance(m, Twist | Imu)]
    turns = [np.abs(np.atleast_2d(m.w_B_radps)) for m in readings]
    axis = int(np.argmax(np.concatenate(turns).mean(axis=0)))
    held: list[float] = []

    def change(m: Any) -> Message:
        if m.t_ns < t:
            return m  # type: ignore[no-any-return]
        rates = np.array(m.w_B_radps)
        held.append(float(np.atleast_2d(rates)[0, axis]))
        rates[..., axis] = held[0]
        return replace(m, w_B_radps=rates)  # type: ignore[no-any-return]

    return _each(messages, MOTION, change)


def frozen(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes the camera repeat its picture for some seconds."""
    until = t + round(chance.uniform(2, 5) * S)
    held: list[Stereo] = []

    def change(m: Stereo) -> Message:
        if m.t_ns < t or not held:
            held[:] = [m]
            return m
        return replace(held[0], t_ns=m.t_ns) if m.t_ns < until else m

    return _each(messages, (Kind.STEREO,), change)


def clock_step(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes the camera's clock step forward, or back, for good; the order of messages stays."""
    by = round(chance.choice([-1, 1]) * chance.uniform(0.3, 1.5) * S)

    def change(m: Stereo) -> Message:
        return replace(m, t_ns=m.t_ns + by) if m.t_ns >= t else m

    return _each(messages, (Kind.STEREO,), change)


def all_clocks_step(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes the clock that stamps everything step forward by some seconds."""
    by = round(chance.uniform(1.5, 20) * S)

    def change(m: Any) -> Message:
        return replace(m, t_ns=m.t_ns + by) if m.t_ns >= t else m  # type: ignore[no-any-return]

    return _each(messages, DATA, change)


def blur(messages: Messages, t: int, chance: Chance) -> Messages:
    """Moves most points for half a second and more, in both images alike."""
    until = t + round(chance.uniform(0.5, 0.9) * S)

    def change(m: Stereo) -> Message:
        if not t <= m.t_ns < until:
            return m
        off = chance.normal(scale=12.0, size=(len(m.ids), 2)).astype(np.float32)
        return replace(m, pixels=m.pixels + off[:, [0, 1, 0, 1]])

    return _each(messages, (Kind.STEREO,), change)


def lost_tracks(messages: Messages, t: int, chance: Chance) -> Messages:
    """Makes it dark for some seconds, or not; from then on all ids are new, as after darkness."""
    until = t + round(chance.uniform(0.3, 3) * S)
    dark = chance.random() < 0.5

    def change(m: Stereo) -> Message:
        if m.t_ns < t:
            return m
        if dark and m.t_ns < until:
            return replace(m, ids=m.ids[:0], pixels=m.pixels[:0])
        return replace(m, ids=m.ids ^ np.uint32(1 << 30))

    return _each(messages, (Kind.STEREO,), change)


def jump(messages: Messages, t: int, chance: Chance) -> Messages | None:
    """Cuts a part of the drive out, as if the robot was carried, unseen by its odometry.

    The camera must still see enough of what it saw, or nobody could notice; None where it never
    does.
    """
    before = [m for m in messages if isinstance(m, Stereo) and m.t_ns < t][-1]
    frames = [m for m in messages if isinstance(m, Stereo) and m.t_ns >= t]
    begin = frames[0]
    far = [
        m
        for m in frames[2:]
        if m.t_ns - begin.t_ns <= chance.uniform(0.7, 1.5) * S
        and len(np.intersect1d(m.ids, before.ids)) >= SURVIVE
    ]
    if not far or far[-1].t_ns - begin.t_ns < JUMP_LEAST_S * S:
        return None
    end = far[-1].t_ns

    def change(m: Any) -> Message | None:
        if m.t_ns < begin.t_ns:
            return m  # type: ignore[no-any-return]
        return replace(m, t_ns=m.t_ns - end + begin.t_ns) if m.t_ns >= end else None

    kept = _each(messages, DATA, change)
    return [m for m in kept if not isinstance(m, Truth)]


def shock(messages: Messages, t: int, chance: Chance) -> Messages:
    """Adds a hit of two or three tenths of a second: readings far off, and blur."""
    until = t + round(chance.uniform(0.2, 0.4) * S)
    most = {kind: _largest(messages, kind) for kind in MOTION}

    def change(m: Any) -> Message:
        if not t <= m.t_ns < until:
            return m  # type: ignore[no-any-return]
        if isinstance(m, Stereo):
            blur = chance.normal(scale=6.0, size=(len(m.ids), 2)).astype(np.float32)
            return replace(m, pixels=m.pixels + blur[:, [0, 1, 0, 1]])
        names = ("a_B_mps2", "w_B_radps") if isinstance(m, Imu) else ("v_B_mps", "w_B_radps")
        hit = {
            name: getattr(m, name)
            + chance.choice([-1, 1], getattr(m, name).shape) * chance.uniform(2, 4) * largest
            for name, largest in zip(names, most[m.kind], strict=True)
        }
        return replace(m, **hit)  # type: ignore[no-any-return]

    return _each(messages, (*MOTION, Kind.STEREO), change)


def _largest(messages: Messages, kind: Kind) -> tuple[float, float]:
    """Returns the largest component of each of the two vectors of readings."""
    readings = [m for m in messages if m.kind == kind]
    if not readings:
        return 0.0, 0.0
    first = "a_B_mps2" if kind == Kind.IMU else "v_B_mps"
    return tuple(  # type: ignore[return-value]
        max(float(np.abs(getattr(m, name)).max()) for m in readings)
        for name in (first, "w_B_radps")
    )


def unchanged(messages: Messages, t: int, chance: Chance) -> Messages:  # noqa: ARG001
    """Leaves the messages unchanged."""
    return messages


EVENTS = (
    Event("slip", ("slip",), slip, True),
    Event("dead encoder", ("dead-odometry",), dead_encoder, True),
    Event("dead gyro", ("dead-gyro",), dead_gyro),
    Event("dead axis", ("dead-gyro",), dead_axis),
    Event("frozen picture", ("frozen-picture",), frozen),
    Event("clock step", ("clock-step",), clock_step),
    Event("all clocks step", ("clock-step",), all_clocks_step),
    Event("wrong matches", ("wrong-matches",), blur),
    Event("lost tracks", ("lost-tracks",), lost_tracks),
    Event("jump", ("jump",), jump),
    Event("shock", ("shock",), shock),
    Event(
        "wrong settings",
        ("settings",),
        unchanged,
        settings=(
            ("--pixel-sigma", "0.1"),
            ("--velocity-sigma", "0.001", "--gyro-sigma", "0.0001"),
            ("--gyro-sigma", "0.00003"),
        ),
        wheels=True,
        whole=True,
    ),
)


def moving(messages: Messages, for_s: float = 4.0) -> Iterator[int]:
    """Yields times from which the picture moves for a while as usual, so that an event shows."""
    frames = [m for m in messages if isinstance(m, Stereo)]
    flow = np.array([_flow(a, b) for a, b in pairwise(frames)])
    t = np.array([m.t_ns for m in frames[1:]])
    usual = np.median(flow)
    first, last = t[0] + (t[-1] - t[0]) // 3, t[-1] - round(for_s * S)
    for now in t[(t >= first) & (t <= last)].tolist():
        ahead = flow[(t >= now) & (t <= now + for_s * S)]
        if len(ahead) and np.min(ahead) > 0.3 * usual:
            yield now


def _flow(a: Stereo, b: Stereo) -> float:
    """Returns the mean motion of the points in both pictures, px."""
    _, i, j = np.intersect1d(a.ids, b.ids, return_indices=True)
    if len(i) < 5:
        return 0.0
    return float(np.abs(a.pixels[i] - b.pixels[j])[:, :2].max(axis=1).mean())
