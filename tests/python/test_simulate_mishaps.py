# SPDX-License-Identifier: MIT
"""What goes wrong on a simulated drive: each mishap is what it says, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import drives
import numpy as np
import pytest
from converted import Run, messages_of
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.io.tracks import triangulate
from pelorus.math import se3
from pelorus.simulate import sensors
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Message, Stereo, Twist
from pelorus.wire.layout import Floats

PERFECT = replace(drives.PERFECT, duration_s=12.0, loss=Options.loss, keep_ids=True)
NOISY = Options(duration_s=6.0)


def with_mishaps(options: Options = PERFECT, **mishaps: Any) -> Recording:
    return simulate(replace(options, mishaps=Mishaps(**mishaps))).recording


def seen_in_world(recording: Recording) -> Floats:
    """(n, 3): where each observation puts its point, by the told camera and the true pose."""
    tracks = recording.tracks
    at = np.searchsorted(recording.truth_t_ns, recording.frame_t_ns)[tracks.frame]
    T_WC = se3.compose(recording.truth.at(at), se3.inverse(sensors.T_CB))
    return se3.apply(T_WC, triangulate(recording.header.camera, tracks.pixels))


def seconds(recording: Recording) -> Floats:
    """(n,): of each observation."""
    return np.asarray(recording.frame_t_ns[recording.tracks.frame] * 1e-9)


def assert_same_images(one: Recording, other: Recording) -> None:
    assert np.array_equal(one.tracks.id, other.tracks.id)
    assert np.array_equal(one.tracks.pixels, other.tracks.pixels)


def assert_same_twists(one: Recording, other: Recording) -> None:
    assert np.array_equal(one.v_B_mps, other.v_B_mps)
    assert np.array_equal(one.w_B_radps, other.w_B_radps)


# --- twists ---------------------------------------------------------------------------------------


def test_slip_multiplies_the_readings_of_its_time_and_changes_no_image() -> None:
    plain, slipping = with_mishaps(NOISY), with_mishaps(NOISY, slip=0.5, slip_span=Span(2.0, 1.5))
    t_s = plain.twist_t_ns * 1e-9
    during = (t_s >= 2.0) & (t_s < 3.5)
    assert np.array_equal(slipping.v_B_mps[during], 0.5 * plain.v_B_mps[during])
    assert np.array_equal(slipping.w_B_radps[during], 0.5 * plain.w_B_radps[during])
    assert np.array_equal(slipping.v_B_mps[~during], plain.v_B_mps[~during])
    assert np.array_equal(slipping.w_B_radps[~during], plain.w_B_radps[~during])
    assert_same_images(plain, slipping)
    assert np.array_equal(plain.truth.p, slipping.truth.p)


def test_a_span_without_a_length_lasts_to_the_end() -> None:
    plain, slipping = with_mishaps(NOISY), with_mishaps(NOISY, slip=2.0, slip_span=Span(4.0))
    after = plain.twist_t_ns >= 4_000_000_000
    assert np.array_equal(slipping.v_B_mps[after], 2.0 * plain.v_B_mps[after])
    assert np.array_equal(slipping.v_B_mps[~after], plain.v_B_mps[~after])


def test_a_dead_encoder_reads_exactly_zero_and_the_gyro_goes_on() -> None:
    plain, dead = with_mishaps(NOISY), with_mishaps(NOISY, dead_encoder=Span(1.0, 2.0))
    t_s = plain.twist_t_ns * 1e-9
    during = (t_s >= 1.0) & (t_s < 3.0)
    assert not dead.v_B_mps[during].any()
    assert np.array_equal(dead.v_B_mps[~during], plain.v_B_mps[~during])
    assert np.array_equal(dead.w_B_radps, plain.w_B_radps)
    assert_same_images(plain, dead)


def test_late_twists_stand_behind_newer_frames_with_their_own_times(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "late.plr"
    options = ("--duration", 2, "--drop", 0, "--twist-delay", 0.015)
    pelorus("simulate", target, *options)
    messages: list[Message] = [frame.message for frame in framing.read_file(target)[0]]
    first = next(k for k, m in enumerate(messages) if isinstance(m, Stereo) and m.t_ns == 10**9)
    times = [m.t_ns for m in messages[first + 1 :] if isinstance(m, Twist)]
    assert times[:2] == [990_000_000, 1_000_000_000]
    assert len(messages_of(target, Twist)) == 201


# --- images ---------------------------------------------------------------------------------------


def test_a_frozen_camera_repeats_its_last_frame_under_new_times() -> None:
    plain, frozen = with_mishaps(NOISY), with_mishaps(NOISY, frozen=Span(2.0, 1.0))
    assert np.array_equal(plain.frame_t_ns, frozen.frame_t_ns)
    t_s = frozen.frame_t_ns * 1e-9
    last = int(np.nonzero(t_s < 2.0)[0][-1])
    before, after = plain.tracks.bounds(), frozen.tracks.bounds()
    for k, t in enumerate(t_s):
        source = last if 2.0 <= t < 3.0 else k
        due = slice(before[source], before[source + 1])
        got = slice(after[k], after[k + 1])
        assert np.array_equal(frozen.tracks.id[got], plain.tracks.id[due])
        assert np.array_equal(frozen.tracks.pixels[got], plain.tracks.pixels[due])
    assert_same_twists(plain, frozen)


def test_the_outliers_of_a_frozen_frame_are_known_too() -> None:
    found = simulate(replace(NOISY, mishaps=Mishaps(frozen=Span(0.0, 2.0))))
    assert len(found.outlier) == len(found.recording.tracks)
    first = found.recording.tracks.frame == 0
    tenth = found.recording.tracks.frame == 10
    assert np.array_equal(found.outlier[first], found.outlier[tenth])


def test_tracks_wander_with_the_root_of_their_age_in_both_images_alike() -> None:
    plain = with_mishaps(replace(PERFECT, loss=0.0))
    drifting = with_mishaps(replace(PERFECT, loss=0.0), track_drift=2.0)
    assert np.array_equal(plain.tracks.id, drifting.tracks.id)
    off = drifting.tracks.pixels - plain.tracks.pixels
    assert np.allclose(off[:, :2], off[:, 2:], atol=1e-9), "the disparity stays"
    born: dict[int, tuple[int, int]] = {}
    ages = []
    for frame, id in zip(plain.tracks.frame.tolist(), plain.tracks.id.tolist(), strict=True):
        begun, last = born.get(id, (frame, frame))
        begun = frame if frame > last + 1 else begun
        born[id] = begun, frame
        ages.append(0.1 * (frame - begun))
    age_s = np.array(ages)
    assert not off[age_s == 0].any()
    for due_s in (0.5, 2.0):
        of_age = np.isclose(age_s, due_s)
        assert off[of_age][:, :2].std() == pytest.approx(2.0 * np.sqrt(due_s), rel=0.15)
    assert_same_twists(plain, drifting)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_so_many_landmarks_move_at_the_speed_asked_for_while_it_lasts(share: float) -> None:
    moving = with_mishaps(
        moving=share, moving_speed_mps=0.3 if share else 0.0, moving_span=Span(4.0, 4.0)
    )
    points, t_s = seen_in_world(moving), seconds(moving)
    moved, seen = 0, 0
    for id in np.unique(moving.tracks.id):
        mine = moving.tracks.id == id
        during = mine & (t_s >= 4.0) & (t_s <= 8.0)
        others = (mine & (t_s <= 4.0), mine & (t_s >= 8.0))
        assert all(np.ptp(points[part], axis=0).max() < 1e-6 for part in others if part.any())
        if during.sum() > 1:
            seen += 1
            way = points[during][-1] - points[during][0]
            span_s = t_s[during][-1] - t_s[during][0]
            speed = np.linalg.norm(way) / span_s
            assert speed == pytest.approx(0.3, rel=1e-6) or speed < 1e-6
            moved += bool(speed > 1e-6)
            assert abs(way[2]) < 1e-6
    assert seen > 50
    assert moved / seen == pytest.approx(share, abs=0.12)


def test_a_convoy_goes_along_at_its_share_of_the_robots_way() -> None:
    convoy = with_mishaps(moving=1.0, convoy=0.8)
    points, tracks = seen_in_world(convoy), convoy.tracks
    for id in np.unique(tracks.id):
        mine = np.nonzero(tracks.id == id)[0]
        first, last = mine[0], mine[-1]
        way = convoy.truth.p[tracks.frame[last]] - convoy.truth.p[tracks.frame[first]]
        assert np.allclose(points[last] - points[first], 0.8 * way, atol=1e-6)


# --- the body and the scene -----------------------------------------------------------------------


def test_a_jump_sets_the_body_aside_and_no_twist_tells() -> None:
    plain, jumped = with_mishaps(), with_mishaps(jump_m=1.5, jump_at_s=5.0)
    aside = jumped.truth.p - plain.truth.p
    at = plain.truth_t_ns >= 5_000_000_000
    assert not aside[~at].any()
    first = int(np.nonzero(at)[0][0])
    assert np.allclose(aside[at], 1.5 * plain.truth.R[first][:, 1], atol=1e-12)
    assert_same_twists(plain, jumped)
    assert np.ptp(seen_in_world(jumped)[jumped.tracks.id == jumped.tracks.id[0]], 0).max() < 1e-6


def test_a_parked_robot_does_not_move_at_all() -> None:
    parked = simulate(replace(PERFECT, parked=True)).recording
    assert not parked.v_B_mps.any()
    assert not parked.w_B_radps.any()
    assert (parked.truth.p == parked.truth.p[0]).all()
    assert parked.tracks.counts().min() > 0
    assert (parked.tracks.counts() == parked.tracks.counts()[0]).sum() > 1


def test_a_far_scene_is_seen_between_its_depths(tmp_path: Path, pelorus: Run) -> None:
    far = simulate(replace(PERFECT, min_depth_m=50.0, max_depth_m=400.0)).recording
    depth = triangulate(far.header.camera, far.tracks.pixels)[:, 2]
    assert depth.min() >= 50.0
    assert depth.max() <= 400.0
    assert np.median(depth) > 100.0
    assert far.tracks.counts().min() > 20
    target = tmp_path / "far.plr"
    said = pelorus("simulate", target, "--duration", 2, "--min-depth", 50, "--max-depth", 400)
    assert said.err == ""


@pytest.mark.parametrize("speed", [0.0, 15.0])
def test_speeds_at_the_ends_are_simulated(speed: float) -> None:
    recording = simulate(replace(PERFECT, speed_mps=speed)).recording
    assert recording.tracks.counts().min() > 0
    way = np.linalg.norm(np.diff(recording.truth.p, axis=0), axis=1).sum()
    assert way == pytest.approx(speed * 12.0, rel=0.2, abs=1e-9)


# --- the calibration ------------------------------------------------------------------------------


def test_the_baseline_is_the_one_asked_for(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "narrow.plr"
    pelorus("simulate", target, "--duration", 2, "--baseline", 0.05)
    assert messages_of(target, Header)[0].camera.baseline_m == 0.05
    narrow = simulate(replace(PERFECT, baseline_m=0.05)).recording
    points = seen_in_world(narrow)
    assert np.ptp(points[narrow.tracks.id == narrow.tracks.id[0]], axis=0).max() < 1e-6


@pytest.mark.parametrize("percent", [2.0, -2.0])
def test_a_wrong_baseline_scales_what_is_seen_and_the_header_does_not_tell(percent: float) -> None:
    plain = with_mishaps()
    wrong = with_mishaps(baseline_error_percent=percent)
    assert vars(wrong.header.camera) == vars(plain.header.camera)
    disparity = wrong.tracks.pixels[:, 0] - wrong.tracks.pixels[:, 2]
    mine = (wrong.tracks.frame == 0)[:, None] & (wrong.tracks.id[:, None] == plain.tracks.id)
    ours, theirs = np.nonzero(mine & (plain.tracks.frame == 0))
    assert len(ours) > 10
    due = plain.tracks.pixels[theirs, 0] - plain.tracks.pixels[theirs, 2]
    assert np.allclose(disparity[ours], (1 + percent / 100) * due)


def test_a_wrong_focal_length_stretches_the_image_about_its_middle() -> None:
    plain, wrong = with_mishaps(), with_mishaps(focal_error_percent=1.0)
    assert vars(wrong.header.camera) == vars(plain.header.camera)
    mine = (wrong.tracks.frame == 0)[:, None] & (wrong.tracks.id[:, None] == plain.tracks.id)
    ours, theirs = np.nonzero(mine & (plain.tracks.frame == 0))
    assert len(ours) > 10
    middle = np.array([320.0, 240.0, 320.0, 240.0])
    due = middle + 1.01 * (plain.tracks.pixels[theirs] - middle)
    assert np.allclose(wrong.tracks.pixels[ours], due)


def test_a_turned_camera_sees_every_point_in_another_direction() -> None:
    degrees = 2.0
    plain, wrong = with_mishaps(), with_mishaps(camera_turned_deg=degrees)
    assert np.array_equal(wrong.header.R_CB, plain.header.R_CB)
    mine = (wrong.tracks.frame == 0)[:, None] & (wrong.tracks.id[:, None] == plain.tracks.id)
    ours, theirs = np.nonzero(mine & (plain.tracks.frame == 0))
    assert len(ours) > 10
    seen = triangulate(plain.header.camera, wrong.tracks.pixels[ours])
    due = triangulate(plain.header.camera, plain.tracks.pixels[theirs])
    turn = se3.exp(np.zeros(3), np.radians(degrees) / np.sqrt(3.0) * np.ones(3)).R
    assert np.allclose(seen, due @ turn.T)
    assert plain.settings["camera-turn-sigma"] == 0.0
    assert not wrong.settings


# --- what is told and refused ---------------------------------------------------------------------


def test_a_scene_in_which_nothing_is_seen_is_refused_and_one_of_gaps_told(
    tmp_path: Path, pelorus: Run
) -> None:
    target = tmp_path / "x.plr"
    said = pelorus("simulate", target, "--duration", 2, "--range", 0.1, status=1)
    assert "nothing is seen in " in said.err
    assert "more --landmarks, a longer --range" in said.err
    assert not target.exists()
    said = pelorus("simulate", target, "--duration", 20, "--landmarks", 5)
    assert "warning: nothing is seen in " in said.err
    assert any(m.kind == Kind.STEREO and not len(m.ids) for m in messages_of(target, Stereo))


def test_mishaps_are_options_of_the_command(tmp_path: Path, pelorus: Run) -> None:
    target, again = tmp_path / "a.plr", tmp_path / "b.plr"
    options = [
        *("--duration", 3, "--slip", 0.5, "--slip-from", 1, "--slip-for", 1, "--frozen-from", 2),
        *("--frozen-for", 0.5, "--dead-encoder-from", 0.5, "--dead-encoder-for", 0.2),
        *("--track-drift", 0.5, "--moving", 0.3, "--convoy", 0.8, "--moving-from", 1),
        *("--moving-for", 1, "--jump", 0.5, "--jump-at", 2, "--baseline-error", 2),
        *("--focal-error", -1, "--twist-delay", 0.005, "--moving-speed", 0.1),
        *("--camera-turned", 0.5),
    ]
    pelorus("simulate", target, *options)
    mishaps = Mishaps(
        slip=0.5,
        slip_span=Span(1, 1),
        dead_encoder=Span(0.5, 0.2),
        twist_delay_s=0.005,
        frozen=Span(2, 0.5),
        track_drift=0.5,
        moving=0.3,
        moving_speed_mps=0.1,
        convoy=0.8,
        moving_span=Span(1, 1),
        jump_m=0.5,
        jump_at_s=2,
        baseline_error_percent=2,
        focal_error_percent=-1,
        camera_turned_deg=0.5,
    )
    simulate(Options(duration_s=3, mishaps=mishaps)).recording.write(again)
    assert target.read_bytes() == again.read_bytes()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--slip", -1), "--slip is -1.0: a factor, not negative"),
        (("--moving", 0.5), "--moving is 0.5: --moving-speed or --convoy"),
        (("--convoy", 0.8), "--moving is 0.0: the share that moves"),
        (("--moving", 2, "--convoy", 1), "--moving is 2.0: a fraction from 0 to 1"),
        (("--frozen-for", 3), "--frozen-for is 3.0: it needs --frozen-from"),
        (("--frozen-from", -3), "--frozen-from is -3.0: a number of seconds"),
        (("--slip-for", "nan"), "--slip-for is nan"),
        (("--baseline-error", 80), "--baseline-error is 80.0: a number of percent"),
        (("--camera-turned", 90), "--camera-turned is 90.0: a number of degrees from -20 to 20"),
        (("--jump", "inf"), "--jump is inf: a finite number"),
        (("--baseline", 0), "--baseline is 0.0: a positive number"),
        (("--min-depth", 5, "--max-depth", 4), "--max-depth is 4.0: more than --min-depth"),
    ],
)
def test_mishaps_that_make_no_sense_are_refused_by_name(
    tmp_path: Path, pelorus: Run, options: tuple[object, ...], said: str
) -> None:
    found = pelorus("simulate", tmp_path / "x.plr", "--duration", 1, *options, status=1)
    assert said in found.err
    assert list(tmp_path.iterdir()) == []


def test_the_simulator_refuses_them_without_the_command_too() -> None:
    with pytest.raises(PelorusError, match="--track-drift is nan"):
        with_mishaps(track_drift=float("nan"))
