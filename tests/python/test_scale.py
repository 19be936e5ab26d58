# SPDX-License-Identifier: MIT
"""A scale that stereo and odometry disagree in is told from biases and from a clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from pelorus.check import clock, scale, search, tuning
from pelorus.check.biases import WIDE
from pelorus.check.contents import scaled
from pelorus.check.options import Settings
from pelorus.check.outcome import NOTHING, SCALE, Bench
from pelorus.frames import Twist
from replay_drive import drive, header
from report_runs import built_programs

TRUE = {"pixel-sigma": "0.5", "velocity-sigma": "0.05", "gyro-sigma": "0.005"}


def simulated(folder: Path, *options: str) -> Path:
    from pelorus.cli import main  # noqa: PLC0415 - typer is slow to load

    noise = [word for name, value in TRUE.items() for word in (f"--{name}", value)]
    path = folder / "drive.plr"
    rates = ("--duration", "30", "--lap", "8", "--twist-rate", "50", "--observations", "25")
    assert main(["simulate", str(path), "--seed", "5", *noise, *rates, *options]) == 0
    return path


@pytest.mark.parametrize(
    ("options", "off"),
    [
        (("--baseline-error", "4"), -0.04),
        (("--baseline-error", "-4"), 0.04),
        (("--bias-velocity-sigma", "0.03"), 0.0),
        (("--bias-velocity-sigma", "0"), 0.0),
    ],
    ids=["4 %", "-4 %", "bias", "clean"],
)
def test_a_baseline_that_is_off_is_told_and_a_bias_of_the_velocity_is_none(
    tmp_path: Path, options: tuple[str, ...], off: float
) -> None:
    bench = Bench(built_programs().float32, simulated(tmp_path, *options), tmp_path)
    assert scale.off_by(bench, TRUE | WIDE) == pytest.approx(off, abs=0.015 if off else 0)


def test_what_a_scale_explains_is_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    def of_twists(_: Bench, settings: Settings) -> clock.Offset:
        """A scale that is off moves the best offset, too."""
        wrong = abs(float(settings[SCALE]) - 0.98) > 0.005
        return clock.Offset(-0.03 if wrong else 0.001, 0.002)

    monkeypatch.setattr(clock, "of_twists", of_twists)
    monkeypatch.setattr(clock, "seconds", lambda _: 0.02)
    monkeypatch.setattr(tuning, "search_noises", lambda *_: search.Found({"pixel": 0.5}, NOTHING))
    examined = SimpleNamespace(twist_t_ns=[])
    bench = cast(Any, SimpleNamespace(header=header(), examined=examined))
    invented, _, _ = tuning.clocked(bench, {}, {"pixel": 0.5}, {})
    assert float(invented["@offset"]) == -0.03
    kept, _, words = tuning.clocked(bench, {}, {"pixel": 0.5}, {}, -0.02)
    assert float(kept["@offset"]) == 0
    assert "no offset of the camera's clock is likelier than yours (known to 4 ms)" in words


def test_velocities_of_another_scale_keep_their_noise_and_their_turns() -> None:
    chance = np.random.default_rng(4)
    steady = drive(200)
    noise = [chance.normal(0, 0.2, 3) for m in steady if isinstance(m, Twist)]
    left = iter(noise)
    noisy = [
        replace(m, v_B_mps=m.v_B_mps + next(left)) if isinstance(m, Twist) else m for m in steady
    ]
    before = [m for m in noisy if isinstance(m, Twist)]
    after = [m for m in scaled(noisy, 1.1) if isinstance(m, Twist)]
    assert all(list(a.w_B_radps) == list(b.w_B_radps) for a, b in zip(after, before, strict=True))
    added = np.array([a.v_B_mps - b.v_B_mps for a, b in zip(after, before, strict=True)])
    assert np.mean(added[:, 0]) == pytest.approx(0.1 * np.mean([m.v_B_mps[0] for m in before]), 0.1)
    assert np.std(added, axis=0).max() < 0.1 * 0.2 / 3  # a mean of some twenty readings
