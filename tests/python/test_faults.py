# SPDX-License-Identifier: MIT
"""The faults of the course's files: found where they were put in, not found where they were not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from draws import draws
from drives import (
    FORWARD_RIGHT_DOWN,
    at_rest,
    clean,
    with_camera_position,
    with_stale_tracks,
    with_turned_axes,
)
from pelorus.faults import stale
from pelorus.faults.mend import mend
from pelorus.io.recording import Recording
from pelorus.math import se3
from pelorus.math.axes import FORWARD_LEFT_UP_IN_CAMERA, body_axes, name, turns
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, TwistTiming
from pelorus.wire.layout import Floats
from pelorus_course import timing

SEEDS = draws([1, 2])
STALE = range(7, 590, 9)


def same_extrinsic(one: Recording, other: Recording) -> bool:
    return np.allclose(one.T_CB.R, other.T_CB.R) and np.allclose(one.T_CB.p, other.T_CB.p)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"velocity_sigma_mps": 0.5, "gyro_sigma_radps": 0.05},
        {"bias_velocity_sigma_mps": 0.2, "bias_gyro_sigma_radps": 0.02},
        {"pixel_sigma_px": 0.0, "velocity_sigma_mps": 0.0, "gyro_sigma_radps": 0.0},
        {"outliers": 0.2},
        {"lap_s": 1e9},
        {"duration_s": 8.0},
        {"duration_s": 0.3},
    ],
    ids=["plain", "noisy", "biased", "perfect", "outliers", "straight", "short", "four frames"],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_clean_drive_is_left_alone(seed: int, changes: dict[str, float]) -> None:
    recording = clean(seed, **changes)
    mended = mend(recording)
    assert not any(finding.found for finding in (*mended.changes, *mended.told)), mended
    assert mended.recording is recording


def test_a_camera_at_rest_may_repeat_its_pixels() -> None:
    recording = at_rest()
    mended = mend(recording)
    assert not any(finding.found for finding in mended.changes), mended.changes
    assert mended.recording is recording


def test_pictures_that_stand_still_are_no_stale_tracks() -> None:
    resting = at_rest()
    frozen = replace(resting, v_B_mps=resting.v_B_mps + np.array([1.0, 0, 0]))
    split, _ = stale.mend(frozen)
    assert split.tracks is not frozen.tracks
    mended = mend(frozen)
    assert mended.recording.tracks is frozen.tracks
    told = {finding.subject: finding for finding in (*mended.changes, *mended.told)}
    assert told["stale tracks"].action.startswith("left as given")
    assert "frozen" in told
    assert told["frozen"].found


@pytest.mark.parametrize("seed", SEEDS)
def test_stale_tracks_get_new_ids_where_they_repeat_and_only_there(seed: int) -> None:
    broken, repeated = with_stale_tracks(clean(seed), STALE)
    mended, finding = stale.mend(broken)
    assert finding.found
    assert f"in {len(STALE)} of" in finding.evidence
    assert f"{repeated} observations" in finding.evidence
    before, after = broken.tracks, mended.tracks
    assert len(before) == len(after)
    old = {(f, tuple(p)): i for f, p, i in zip(before.frame, before.pixels, before.id, strict=True)}
    pieces: dict[int, set[tuple[int, int]]] = {}
    for f, p, i in zip(after.frame, after.pixels, after.id, strict=True):
        breaks = sum(1 for k in STALE if k <= f)  # every live track breaks there
        pieces.setdefault(int(i), set()).add((int(old[f, tuple(p)]), breaks))
    live_at_break = sum(len(piece) - 1 for piece in pieces.values())
    assert live_at_break == 0, "a new id joins two points"
    assert len(pieces) == len(np.unique(before.id)) + repeated


def test_a_track_that_repeats_alone_is_no_stale_frame() -> None:
    recording = clean()
    tracks = recording.tracks
    pairs = tracks.pairs(1)
    half = pairs.second[::2]
    pixels = tracks.pixels.copy()
    pixels[half] = pixels[pairs.first[::2]]
    _, finding = stale.mend(replace(recording, tracks=replace(tracks, pixels=pixels)))
    assert not finding.found
    assert "single repeats" in finding.evidence


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("F", turns()[1::5], ids=str)
def test_turned_axes_are_found_and_turned_back(seed: int, F: Floats) -> None:
    recording = clean(seed)
    mended = mend(with_turned_axes(recording, F))
    finding = mended.changes[-1]
    assert finding.found, finding
    assert finding.subject == "axes"
    assert same_extrinsic(mended.recording, recording)
    assert "forward-left-up" in finding.action


def test_turned_axes_are_found_under_a_gyro_bias_and_noise() -> None:
    recording = clean(4, bias_gyro_sigma_radps=0.02, gyro_sigma_radps=0.05, velocity_sigma_mps=0.5)
    mended = mend(with_turned_axes(recording))
    assert mended.changes[-1].found
    assert same_extrinsic(mended.recording, recording)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("changes", [{}, {"velocity_sigma_mps": 0.2, "gyro_sigma_radps": 0.03}])
def test_a_cameras_position_as_translation_is_found_and_mended(
    seed: int, changes: dict[str, float]
) -> None:
    recording = clean(seed, **changes)
    mended = mend(with_camera_position(recording))
    finding = mended.changes[-1]
    assert finding.found, finding
    assert finding.subject == "lever"
    assert same_extrinsic(mended.recording, recording)


def test_on_a_straight_way_its_sway_tells_the_lever_and_too_few_frames_do_not() -> None:
    straight = clean(1, lap_s=1e9)
    assert same_extrinsic(mend(with_camera_position(straight)).recording, straight)
    short = with_camera_position(clean(1, lap_s=1e9, duration_s=4.0))
    mended = mend(short)
    assert mended.recording is short
    assert not any(finding.found for finding in (*mended.changes, *mended.told))
    assert not all(finding.is_conclusive for finding in mended.told)


def test_all_faults_at_once_are_mended_in_turn() -> None:
    recording = clean(2)
    broken, repeated = with_stale_tracks(recording, STALE)
    broken = with_turned_axes(with_camera_position(broken))
    mended = mend(broken)
    assert [finding.subject for finding in mended.changes] == ["stale tracks", "axes", "lever"]
    assert all(finding.found for finding in mended.changes), mended.changes
    assert same_extrinsic(mended.recording, recording)
    again = mend(mended.recording)
    assert not any(finding.found for finding in again.changes), "a mended recording is clean"
    assert again.recording is mended.recording
    assert repeated > 0


def test_axes_that_no_turn_explains_are_left_as_given_and_named() -> None:
    recording = clean(3)
    broken = replace(recording, w_B_radps=recording.w_B_radps * [1, 1, -1])
    mended = mend(broken)
    assert same_extrinsic(mended.recording, broken)
    assert "axes" in [finding.subject for finding in mended.told if finding.found]


def test_an_extrinsic_that_does_not_fit_even_then_is_left_as_given_and_that_is_said() -> None:
    """Turned axes, and a camera that is pitched besides."""
    turned = with_turned_axes(clean(3))
    pitch = se3.exp(np.zeros((1, 3)), np.radians([[12.0, 0.0, 0.0]])).R[0]
    broken = turned.with_extrinsic(Poses(pitch @ turned.T_CB.R, turned.T_CB.p))
    mended = mend(broken)
    assert mended.recording is broken
    tried = mended.changes[-1]
    assert tried.subject == "axes"
    assert not tried.found
    assert tried.action.startswith("left as given: even then it would not fit (")
    assert "axes" in [finding.subject for finding in mended.told if finding.found]


@pytest.mark.parametrize("given", [TwistTiming.START, TwistTiming.END])
def test_the_twist_timing_of_the_drive_is_found(given: TwistTiming) -> None:
    recording = clean(1, twist_timing=given, lap_s=8.0, pixel_sigma_px=0.2)
    unsaid = recording.with_header(twist_timing=TwistTiming.MID)
    chosen, finding = timing.choose(unsaid)
    assert chosen.header.twist_timing is given, finding


def test_axes_have_names() -> None:
    R = FORWARD_LEFT_UP_IN_CAMERA
    assert body_axes(R) is BodyAxes.FORWARD_LEFT_UP
    assert body_axes(R @ FORWARD_RIGHT_DOWN) is BodyAxes.FORWARD_RIGHT_DOWN
    backward = R @ np.diag([-1.0, -1.0, 1.0])
    assert body_axes(backward) is BodyAxes.OTHER
    assert name(backward) == "backward-right-up"
    found = turns()
    assert len({tuple(F.ravel()) for F in found}) == 24
    assert np.array_equal(found[0], np.eye(3))
    assert all(np.linalg.det(F) > 0 for F in found)
