# SPDX-License-Identifier: MIT
"""Residuals on a page are those of the frame itself: the pixels' noise, wherever the robot is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pelorus.explain.log import FilterLog, log_of
from pelorus.native.replay import replayed
from pelorus.report.residuals import Residuals, residuals, residuals_of
from pelorus.report.spectra import drawings, plot
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.layout import Floats
from report_runs import built_programs


def log_with(**options: Any) -> FilterLog:
    drive = Options(seed=41, duration_s=15.0, lap_s=12.0, **options)
    messages = list(simulate(drive).recording.messages())
    return log_of(replayed(built_programs().float32, messages, []))


def sigma(found: Residuals) -> Floats:
    off = np.abs(found.off - np.median(found.off, axis=0))
    return np.asarray(1.4826 * np.median(off, axis=0))


@pytest.mark.parametrize("pixel_sigma", [0.3, 1.0])
def test_residuals_are_the_pixels_noise_and_lean_to_no_side(pixel_sigma: float) -> None:
    found = residuals(log_with(pixel_sigma_px=pixel_sigma))
    assert len(found.off) > 2000
    assert np.abs(np.median(found.off, axis=0)).max() < 0.15 * pixel_sigma
    assert sigma(found) == pytest.approx(1.1 * pixel_sigma, rel=0.15)


def test_at_rest_they_are_no_larger() -> None:
    """The landmark as it is known in the end stood several pixels away from what was seen."""
    log = log_with(pixel_sigma_px=0.1, stop=Span(5.0, 8.0))
    for k in (80, 100):
        assert sigma(residuals_of(log, k)).max() < 0.2


def test_the_first_frames_have_none() -> None:
    assert not len(residuals_of(log_with(), 1).off)


def test_an_imus_log_has_spectra_and_residuals_of_both_pictures() -> None:
    made = {one.title: one for one in drawings(log_with(imu=SimulatedImu(imu_rate_hz=100)))}
    assert {"Vibration: specific force", "Vibration: turn rate", "Residuals"} < set(made)
    assert {"Residuals over the left picture", "Residuals over the right picture"} < set(made)
    assert all(one.svg.startswith("<svg") and "nan" not in one.svg for one in made.values())


def test_names_in_a_drawing_are_no_markup() -> None:
    x = np.array([1.0, 2.0, 3.0])
    drawn = plot(x, [("<b>", np.array([1.0, np.nan, 2.0]))], ("<i>", "y"))
    assert "<b>" not in drawn
    assert "<i>" not in drawn
    assert plot(x, [("none", np.full(3, np.nan))], ("", "")) == ""
