# SPDX-License-Identifier: MIT
"""Causes that the data tell and that were guessed: by drives with other numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from draws import draws
from drives import at_rest, clean, with_stale_tracks
from imu_drives import NOISY, noisy, options
from numpy.typing import NDArray
from pelorus.converters import full_scale, repeated
from pelorus.converters.streams import RawTracks, Readings, Streams, Twists, _moves, recording
from pelorus.faults import platform, resolution, sync
from pelorus.faults.geometry import WORLD_SURE, _at_times, _in_world
from pelorus.faults.imu_axes import _units
from pelorus.faults.imu_body import ImuBody
from pelorus.faults.named import _beside_way, _pixels, _times
from pelorus.faults.seen import CameraMotion as SeenMotion
from pelorus.faults.twist_body import TwistBody
from pelorus.faults.two_views import two_views
from pelorus.faults.world_axes import world_axes
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math.inertial import Inertial
from pelorus.rig.read import Calibrated
from pelorus.simulate.simulate import simulate

Floats = NDArray[np.float64]


# --- left and right of different moments ----------------------------------------------------------


def looked_at(drive: Recording) -> sync.PictureDelay | None:
    return sync.apart(drive.tracks, drive.frame_t_ns, drive.header.camera)


def apart_by(drive: Recording, by_s: float) -> Recording:
    """The right pixels as they are so much later, by their own rate between the frames beside."""
    tracks = drive.tracks
    pixels = tracks.pixels.copy()
    pairs = tracks.pairs(1)
    tau = (drive.frame_t_ns[1] - drive.frame_t_ns[0]) * 1e-9
    rate = (tracks.pixels[pairs.second] - tracks.pixels[pairs.first]) / tau
    pixels[pairs.first, 2:] += by_s * rate[:, 2:]
    known = np.zeros(len(tracks), bool)
    known[pairs.first] = True
    kept = Tracks(tracks.frame_count, tracks.frame[known], tracks.id[known], pixels[known])
    return replace(drive, tracks=kept)


@pytest.mark.parametrize("by_ms", [13.0, -34.0])
def test_cameras_that_run_free_are_told_by_how_much(by_ms: float) -> None:
    found = looked_at(apart_by(noisy(7).recording, by_ms * 1e-3))
    assert found is not None
    assert found.found
    assert found.by_s == pytest.approx(by_ms * 1e-3, rel=0.15)
    later = "right" if by_ms > 0 else "left"
    assert f"ms apart, the {later} one later" in found.fault.words
    assert "Trigger both cameras together" in found.fault.words


@pytest.mark.parametrize("seed", draws(range(4)))
def test_cameras_that_are_triggered_together_are_not_accused(seed: int) -> None:
    for drive in (noisy(seed).recording, clean(seed=seed)):
        found = looked_at(drive)
        assert found is None or not found.found


# --- another resolution ---------------------------------------------------------------------------


def scaled(drive: Recording, factor: float, knows_size: bool) -> Recording:
    """The pixels of pictures so many times as large."""
    tracks = replace(drive.tracks, pixels=drive.tracks.pixels * factor)
    size = {} if knows_size else {"image_width_px": 0, "image_height_px": 0}
    return replace(drive, tracks=tracks).with_header(**size)


def filled(drive: Recording) -> Recording:
    """With pixels all over the picture, as a tracker has them."""
    camera, tracks = drive.header.camera, drive.tracks
    chance = np.random.default_rng(3)
    size = np.array([2 * camera.cx_px, 2 * camera.cy_px])
    left = chance.uniform(0.01, 0.99, (len(tracks), 2)) * size
    right = left - np.column_stack((chance.uniform(0, 3, len(left)), np.zeros(len(left))))
    return replace(drive, tracks=replace(tracks, pixels=np.hstack((left, right))))


@pytest.mark.parametrize("factor", [0.25, 0.5, 2 / 3, 1.5, 3.0])
@pytest.mark.parametrize("knows_size", [False, True])
def test_a_calibration_of_another_resolution_is_named(factor: float, knows_size: bool) -> None:
    drive = filled(noisy().recording)
    faults = list(resolution.of_resolution(scaled(drive, factor, knows_size)))
    assert [fault.name for fault in faults] == ["resolution"]
    assert not list(resolution.of_resolution(drive))
    times = f"{1 / factor:g} times as large?"
    if factor < 1 or not knows_size:
        assert times in faults[0].words


def test_tracks_of_one_part_of_the_picture_are_no_other_resolution() -> None:
    drive = filled(noisy().recording)
    pixels = drive.tracks.pixels
    for part in (pixels[:, 1] > np.median(pixels[:, 1]), pixels[:, 0] < np.median(pixels[:, 0])):
        tracks = drive.tracks
        less = Tracks(tracks.frame_count, tracks.frame[part], tracks.id[part], pixels[part])
        assert not list(resolution.of_resolution(replace(drive, tracks=less)))


def streams(drive: Recording) -> Streams:
    frames = RawTracks(Path("stereo.csv"), drive.frame_t_ns, drive.tracks)
    motion: Twists | Readings = Readings(Path("imu.csv"), drive.inertial)
    if not len(drive.inertial.t_ns):
        motion = Twists(Path("odom.csv"), drive.twist_t_ns, drive.v_B_mps, drive.w_B_radps)
    return Streams(Calibrated(drive.header), frames, motion)


def test_pixels_beyond_the_calibrations_picture_are_refused_at_once() -> None:
    drive = filled(noisy().recording)
    camera = drive.header.camera
    size = {"image_width_px": int(2 * camera.cx_px), "image_height_px": int(2 * camera.cy_px)}
    larger = replace(scaled(drive, 1.5, True).with_header(**size))
    with pytest.raises(ForeignFileError, match=r"beyond the .* of pictures 1\.5 times as large"):
        recording(streams(larger))
    recording(streams(drive.with_header(**size)))


# --- an IMU that clips ----------------------------------------------------------------------------


def shaken(peak: float, end: float, lsb: float = 1e-4) -> Floats:
    t = np.arange(6000) / 400
    w = np.stack((peak * np.sin(9 * t), 0.6 * peak * np.sin(5.3 * t + 1), 0.1 * np.sin(t)), axis=-1)
    w += np.random.default_rng(2).normal(0, 0.01, w.shape) + 0.004
    return np.clip(np.round(w / lsb) * lsb, -end, end)


@pytest.mark.parametrize(("end", "peak"), [(8.7266, 11.0), (2.1817, 2.5), (6.1, 9.0)])
def test_a_gyro_that_clips_has_its_range_set_and_told(end: float, peak: float) -> None:
    drive = noisy().recording
    w = shaken(peak, end)
    a = np.tile([0.0, 0.0, 9.81], (len(w), 1)) + 0.01 * shaken(3.0, 99.0)
    readings = Inertial(np.arange(len(w)) * 2_500_000, a, w)
    made, findings = full_scale.with_ranges(replace(drive, inertial=readings), readings)
    assert 0.99 * end < made.settings["gyro-range"] < end
    assert "accel-range" not in made.settings
    assert f"readings stand at the end, {end:.4g} rad/s" in findings[0].evidence


@pytest.mark.parametrize("peak", [0.3, 3.0, 4.3])
@pytest.mark.parametrize("lsb", [1e-6, 1e-3, 0.02])
def test_a_gyro_that_does_not_clip_has_no_range_whatever_its_digits(
    peak: float, lsb: float
) -> None:
    w = shaken(peak, 1e3, lsb)
    assert not full_scale.clips(w, full_scale.GYRO_RANGES).any()
    still = np.round(np.random.default_rng(1).normal(0, lsb, (3000, 3)) / lsb) * lsb
    assert not full_scale.clips(still, full_scale.GYRO_RANGES).any()


# --- frames that repeat ---------------------------------------------------------------------------


@pytest.mark.parametrize("every", [9, 15])
@pytest.mark.parametrize("make", [clean, lambda: noisy().recording])
def test_frames_that_repeat_are_left_out_and_counted(
    every: int, make: Callable[[], Recording]
) -> None:
    drive = make()
    tracks = drive.tracks
    rows: list[Any] = [
        np.nonzero(tracks.frame == (k - 1 if k % every == every - 1 else k))[0]
        for k in range(tracks.frame_count)
    ]
    at = np.concatenate(rows)
    frame = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    stale = Tracks(tracks.frame_count, frame, tracks.id[at], tracks.pixels[at])
    found = streams(replace(drive, tracks=stale))
    moves = _moves(found.motion, drive.frame_t_ns)
    t_ns, kept, findings = repeated.left_out(moves, drive.frame_t_ns, stale, drive.header.camera)
    out = [k for k in range(len(rows)) if k % every == every - 1]
    assert len(t_ns) == kept.frame_count == len(rows) - len(out)
    assert not set(drive.frame_t_ns[out].tolist()) & set(t_ns.tolist())
    assert findings[0].found  # one in fifteen is many
    assert f"{len(out)} of {len(rows)} frames repeat" in findings[0].evidence
    given = (moves, drive.frame_t_ns)
    assert repeated.left_out(*given, tracks, drive.header.camera)[2] == []
    other, _ = with_stale_tracks(drive, range(10, 14))  # of other points from there on
    assert repeated.left_out(*given, other.tracks, drive.header.camera)[2] == []


def test_pictures_that_repeat_are_left_out_but_not_those_of_a_body_that_stands() -> None:
    drive = clean()
    chance = np.random.default_rng(1)
    pictures = chance.integers(0, 255, (len(drive.frame_t_ns), 4, 4))
    moving = repeated.Repeats(_moves(streams(drive).motion, drive.frame_t_ns), drive.frame_t_ns)
    shown = [k - 1 if k in (5, 6, 20) else k for k in range(len(pictures))]
    shown[6] = 4  # twice in a row
    out = [k for k, of in enumerate(shown) if moving.leaves_out(pictures[of], pictures[of])]
    assert out == [5, 6, 20]
    right = repeated.Repeats(_moves(streams(drive).motion, drive.frame_t_ns), drive.frame_t_ns)
    out = [
        k for k, of in enumerate(shown) if right.leaves_out(pictures[k], pictures[of])
    ]  # the right one alone
    assert out == [5, 6, 20]
    still = at_rest()
    standing = repeated.Repeats(_moves(streams(still).motion, still.frame_t_ns), still.frame_t_ns)
    out = [k for k in range(len(still.frame_t_ns)) if standing.leaves_out(*pictures[:2])]
    assert len(out) <= 1


# --- units, platforms, pauses ---------------------------------------------------------------------


def test_no_unit_of_forces_is_accused_where_gravity_is_as_large_as_it_should_be() -> None:
    class Found:
        usual_force = 9.7

    named = [why.words for why in _units(Found())]  # type: ignore[arg-type]
    assert not any("forces are" in words for words in named)
    Found.usual_force = 0.98
    named = [why.words for why in _units(Found())]  # type: ignore[arg-type]
    assert "the IMU's specific forces are in g" in named
    assert not any("thousandths" in words for words in named)


def lifted(drive: Recording, first_s: float, last_s: float, up_mps2: float) -> Recording:
    """In a lift that starts then: its readings have its acceleration, the pictures show none."""
    t = (drive.inertial.t_ns - drive.inertial.t_ns[0]) * 1e-9
    up_W = np.where((t > first_s) & (t < last_s), up_mps2, 0.0)[:, None] * np.array([0, 0, 1.0])
    at = np.clip(np.searchsorted(drive.truth_t_ns, drive.inertial.t_ns), 0, len(drive.truth.R) - 1)
    up_B = np.einsum("nji,nj->ni", drive.truth.R[at], up_W)
    return replace(drive, inertial=drive.inertial._replace(a_B_mps2=drive.inertial.a_B_mps2 + up_B))


def test_a_lift_that_starts_is_told_with_its_time() -> None:
    drive = simulate(options(NOISY, seed=3, duration_s=24.0, pixel_sigma_px=0.5)).recording
    first_s, last_s = 9.0, 11.5

    def wrong_in(one: Recording) -> Any:
        views = two_views(one.tracks, one.header.camera, 1)
        seen = SeenMotion.of(one, views)
        body = ImuBody(one, seen)
        t_s = body.frame_s(one.frame_t_ns, 0.0)
        return platform.spans(t_s, platform.disagreeing(one, seen, body)), seen, body

    spans, seen, body = wrong_in(drive)
    assert spans == []
    assert _at_times(drive, seen, body) is None
    spans, _, _ = wrong_in(lifted(drive, first_s, last_s, 1.4))
    assert len(spans) == 1
    assert abs(spans[0][0] - first_s) < 0.8
    assert abs(spans[0][1] - last_s) < 0.8


def test_a_pause_that_no_track_spans_cannot_be_told() -> None:
    drive = clean(duration_s=12.0)
    t = drive.frame_t_ns
    part = (t < t[0] + 3 * 10**9) | (t > t[0] + 9 * 10**9)
    twists = (drive.twist_t_ns < t[part][:-1].max()) & ~(
        (drive.twist_t_ns > t[0] + 3 * 10**9) & (drive.twist_t_ns < t[0] + 9 * 10**9)
    )
    number = np.cumsum(part) - 1
    kept = part[drive.tracks.frame]
    tracks = Tracks(
        int(part.sum()),
        number[drive.tracks.frame[kept]],
        drive.tracks.id[kept] + 10_000 * (number[drive.tracks.frame[kept]] > 30),
        drive.tracks.pixels[kept],
    )
    less = replace(
        drive,
        frame_t_ns=t[part],
        tracks=tracks,
        twist_t_ns=drive.twist_t_ns[twists],
        v_B_mps=drive.v_B_mps[twists],
        w_B_radps=drive.w_B_radps[twists],
    )
    assert not list(_pixels(less))
    gaps = [f for f in _times("twists", less.twist_t_ns) if f.name == "time-gap"]
    assert len(gaps) == 1
    views = two_views(less.tracks, less.header.camera, 1)
    told = _beside_way(gaps[0], less, views, less.twist_t_ns)
    assert "how far the camera goes in them cannot be told" in told.words
    assert "0 m" not in told.words


def test_wheels_that_stand_while_the_robot_is_lifted_have_no_axes() -> None:
    drive = clean(duration_s=20.0)
    views = two_views(drive.tracks, drive.header.camera, 1)
    seen = SeenMotion.of(drive, views)
    chance = np.random.default_rng(5)
    still = chance.normal(0, 1e-3, drive.v_B_mps.shape)
    lifted_robot = replace(drive, v_B_mps=still, w_B_radps=np.zeros_like(still))
    assert world_axes(lifted_robot, seen) == 0.0
    R = TwistBody(drive).at((drive.twist_t_ns - drive.twist_t_ns[0]) * 1e-9).R
    turned = replace(drive, v_B_mps=np.einsum("kij,kj->ki", R, drive.v_B_mps))
    assert world_axes(turned, seen) > WORLD_SURE
    fault = _in_world(turned, seen)[0]
    assert "--twist-in world" in fault.words  # the remedy beside the cause
