# SPDX-License-Identifier: MIT
"""How far camera and twists disagree, and how well that is known: against what was put in."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from draws import draws
from everyday import drawn
from everyday import drive as everyday_drive
from injected import OF_RECORDINGS
from pelorus.faults import geometry
from pelorus.faults.agreement import Agreement, agreement
from pelorus.faults.amounts import of_clock, of_lever, of_scale
from pelorus.faults.clocks import TwoClocks
from pelorus.faults.fault import Fault
from pelorus.faults.mounting import MotionPairs
from pelorus.faults.moving import Moving
from pelorus.faults.named import faults_in
from pelorus.faults.seen import CameraMotion
from pelorus.faults.two_views import TwoViews, two_views
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math import se3
from pelorus.simulate.simulate import Options, simulate
from pelorus.tracking.second_view import NOISE, inverse

DRIVE = Options(
    duration_s=30.0, twist_rate_hz=50.0, bias_velocity_sigma_mps=0.0, loss=0.03, baseline_m=0.4
)


@cache
def driven(seed: int = 11) -> Recording:
    """No bias of the velocity, and the HEADER says so."""
    recording = simulate(replace(DRIVE, seed=seed)).recording
    noise = replace(recording.header.noise, bias_velocity_sigma_mps=0.0)
    return recording.with_header(noise=noise)


def agreed(recording: Recording) -> Agreement:
    return agreement(recording, two_views(recording.tracks, recording.header.camera, 1))


def scale_in(recording: Recording) -> list[Fault]:
    return [fault for fault in faults_in(recording) if fault.name == "scale"]


def test_the_same_pictures_are_examined_once() -> None:
    recording = driven()
    tracks, camera = recording.tracks, recording.header.camera
    found = two_views(tracks, camera, 1)
    assert two_views(replace(tracks, pixels=tracks.pixels.copy()), camera, 1) is found
    assert two_views(tracks, camera, 2) is not found
    other = tracks.pixels.copy()
    other[0] += 0.5
    assert two_views(replace(tracks, pixels=other), camera, 1) is not found
    with pytest.raises(ValueError, match="read-only"):
        found.motion.p[0] = 0  # all who asked share it


def test_ways_have_the_length_that_they_have() -> None:
    recording = driven()
    views = two_views(recording.tracks, recording.header.camera, 1)
    seen = np.isin(recording.truth_t_ns, recording.frame_t_ns)
    T_WC = se3.compose(recording.truth.at(seen), se3.inverse(recording.T_CB))
    true = se3.compose(se3.inverse(T_WC.at(slice(1, None))), T_WC.at(slice(None, -1)))
    good = views.counts > 20
    along = np.sum(views.motion.p[good] * true.p[good]) / np.sum(true.p[good] ** 2)
    assert along == pytest.approx(1, abs=0.003), "points from one view alone: 1 % too short"
    off = se3.log(se3.compose(views.motion, se3.inverse(true)))[good]
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(views.covariance[good]), off) / 6
    assert 0.5 < np.median(nees) < 1.4
    assert views.sigma_px == pytest.approx(1, rel=0.1)


@pytest.mark.parametrize("factor", [1.0, 1.03, 0.94])
def test_a_scale_is_found_within_its_standard_errors(factor: float) -> None:
    recording = driven()
    found = agreed(replace(recording, v_B_mps=recording.v_B_mps / factor))
    assert abs(found.through_zero - factor) < 3 * found.through_zero_sigma + 0.003
    assert abs(found.scale - factor) < 3 * found.scale_sigma
    assert found.through_zero_sigma < 0.01


def test_two_percent_of_scale_are_named_and_none_is_not() -> None:
    recording = driven()
    assert scale_in(recording) == []
    camera = recording.header.camera
    wrong = recording.with_header(camera=replace(camera, baseline_m=1.025 * camera.baseline_m))
    assert len(scale_in(wrong)) == 1
    assert not scale_in(wrong)[0].stops, "the filter can live with it"


def test_a_bias_that_the_header_tells_of_is_no_scale() -> None:
    recording = driven()
    shifted = replace(recording, v_B_mps=recording.v_B_mps + np.array([0.1, 0, 0]))
    noise = replace(recording.header.noise, bias_velocity_sigma_mps=0.1)
    assert scale_in(shifted.with_header(noise=noise)) == []


def test_a_bias_that_the_settings_allow_is_no_scale() -> None:
    recording = driven()
    noise = replace(recording.header.noise, bias_velocity_sigma_mps=-1.0)
    shifted = replace(recording, v_B_mps=recording.v_B_mps + np.array([0.06, 0, 0]))
    assert len(scale_in(shifted)) == 1, "where there is no bias it is a scale"
    assert scale_in(shifted.with_header(noise=noise)) == []


def test_ways_that_have_nothing_in_common_are_no_scale() -> None:
    recording = driven()
    found = replace(agreed(recording), scale=0.08, scale_sigma=0.06, through_zero=0.1)
    assert [fault.name for fault in of_scale(found, 0.0)] == ["no-fit"]
    unknown = replace(found, scale=1.27, scale_sigma=0.16, speed_mps=0.01)
    assert list(of_scale(unknown, 0.03)) == [], "at one speed no scale is known, and none is missed"
    baseline = replace(found, scale=0.3, scale_sigma=0.01)
    assert [fault.name for fault in of_scale(baseline, 0.0)] == ["scale"]


@pytest.mark.parametrize("late_s", [0.0, 0.03, -0.12])
def test_a_clock_is_found_to_some_milliseconds(late_s: float) -> None:
    recording = driven()
    moved = replace(recording, frame_t_ns=recording.frame_t_ns + round(late_s * 1e9))
    found = agreed(moved)
    assert found.offset_s == pytest.approx(-late_s, abs=0.008)
    assert found.offset_sigma_s < 0.008


@pytest.mark.parametrize("seed", draws([1, 2, 3]))
def test_a_clock_is_known_no_better_than_noisy_twists_tell_it(seed: int) -> None:
    """As 0027 has them: between two readings a mean of both is taken, whose noise is smaller, and
    half a reading early or late looked like the right offset, known to some milliseconds.
    """
    noisy = replace(DRIVE, seed=seed, duration_s=40.0, twist_rate_hz=10.0)
    recording = simulate(replace(noisy, velocity_sigma_mps=0.5, gyro_sigma_radps=0.1)).recording
    found = agreed(recording)
    assert abs(found.offset_s) < 4 * found.offset_sigma_s
    assert [fault.name for fault in faults_in(recording)] == []


def circled(seed: int) -> Recording:
    """Six seconds on a circle at an even speed: of the twists nothing varies but their noise."""
    chance = np.random.default_rng(seed)
    v, w = np.array([0.7, 0.0, 0.0]), np.array([0.0, 0.0, 0.35])
    header = driven().header
    camera = header.camera
    times = np.arange(1, 62) * 0.1
    body = se3.exp(times[:, None] * v, times[:, None] * w)
    points = np.column_stack((chance.uniform(-8, 8, (2000, 2)), chance.uniform(-1, 2, 2000)))
    rows = []
    for k in range(len(times)):
        T_CW = se3.compose(driven().T_CB, se3.inverse(body.at(slice(k, k + 1))))
        q = points @ T_CW.R[0].T + T_CW.p[0]
        ahead = (
            (q[:, 2] > 2) & (np.abs(q[:, 0]) < 0.6 * q[:, 2]) & (np.abs(q[:, 1]) < 0.4 * q[:, 2])
        )
        u = camera.fx_px * q[ahead, 0] / q[ahead, 2] + camera.cx_px
        row = camera.fy_px * q[ahead, 1] / q[ahead, 2] + camera.cy_px
        right = u - camera.fx_px * camera.baseline_m / q[ahead, 2]
        seen = np.column_stack((u, row, right, row)) + chance.normal(0, 0.1, (ahead.sum(), 4))
        rows.append((np.flatnonzero(ahead), seen))
    counts = [len(ids) for ids, _ in rows]
    tracks = Tracks.from_rows(
        len(times),
        np.repeat(np.arange(len(times)), counts),
        np.concatenate([ids for ids, _ in rows]),
        np.concatenate([seen for _, seen in rows]),
    )
    t_ns = np.arange(0, 6201, 20) * 1_000_000
    count = len(t_ns)
    return Recording(
        header,
        t_ns,
        v + chance.normal(0, 0.03, (count, 3)),
        w + chance.normal(0, 0.01, (count, 3)),
        (times * 1e9).astype(np.int64),
        tracks,
    )


@pytest.mark.parametrize("seed", draws(range(8)))
def test_where_nothing_varies_no_clock_is_told_and_no_scale_of_turns(seed: int) -> None:
    """A weak instrument found 0.011 +- 0.046 times the turns, and frames 242 +- 30 ms late."""
    recording = circled(seed)
    found = agreed(recording)
    assert found.turn_scale_sigma == np.inf
    assert found.offset_s == 0
    assert found.offset_sigma_s == np.inf
    assert not {fault.name for fault in faults_in(recording)} & {"scale", "clock", "clock-turns"}


def gyro_late(recording: Recording, readings: int) -> Recording:
    late = np.roll(recording.w_B_radps, readings, axis=0)
    late[:readings] = recording.w_B_radps[0]
    return replace(recording, w_B_radps=late)


def test_a_gyro_that_is_late_is_no_clock_of_the_frames() -> None:
    exact = replace(DRIVE, seed=11, pixel_sigma_px=0.2, velocity_sigma_mps=0.01)
    late = gyro_late(simulate(exact).recording, 6)
    found = agreed(late).clocks
    assert found.turns_late_s == pytest.approx(0.12, abs=4 * found.turns_late_sigma_s)
    assert found.turns_late_sigma_s < 0.02
    assert [fault.name for fault in faults_in(late)] == ["clock-turns"]
    T = late.T_CB
    assert np.linalg.norm(agreed(late).lever_m) < 0.1, "asked of motions that belong together"
    assert np.linalg.norm(T.p) > 0.1, "a drive whose lever would tell"
    both = replace(late, frame_t_ns=late.frame_t_ns + 60 * 10**6)
    named = faults_in(both)
    assert [fault.name for fault in named] == ["clock", "clock-turns"]
    assert "velocities agree best with the frames" in named[0].words


def test_frames_that_are_late_are_no_late_gyro() -> None:
    moved = replace(driven(), frame_t_ns=driven().frame_t_ns + 120 * 10**6)
    assert [fault.name for fault in faults_in(moved)] == ["clock"]


def test_what_spoils_the_result_is_named_before_what_a_setting_mends() -> None:
    moved = replace(driven(), frame_t_ns=driven().frame_t_ns + 120 * 10**6)
    change, _ = OF_RECORDINGS["frozen"]
    assert [fault.name for fault in faults_in(change(moved, 1))] == ["frozen", "clock"]


def pitched(recording: Recording, deg: float) -> Recording:
    tilt = se3.exp(np.zeros(3), np.radians([deg, 0, 0]))
    return recording.with_extrinsic(recording.T_CB._replace(R=tilt.R @ recording.T_CB.R))


@cache
def slow() -> Recording:
    """At 0.5 m/s a bias of three times 0.03 m/s across the way looks like ten degrees."""
    options = replace(DRIVE, seed=7, speed_mps=0.5, velocity_sigma_mps=0.02)
    recording = simulate(options).recording
    noise = replace(recording.header.noise, bias_velocity_sigma_mps=-1.0)
    return recording.with_header(noise=noise)


@pytest.mark.parametrize("deg", [6.0, -8.0])
def test_a_pitch_of_some_degrees_is_named_at_any_speed(deg: float) -> None:
    assert [fault.name for fault in faults_in(slow())] == []
    wrong = pitched(slow(), deg)
    assert faults_in(wrong)[0].name == "pitch"
    tilt = agreed(wrong).tilt_rad
    assert tilt is not None
    assert np.degrees(wrong.T_CB.R[0] @ tilt) == pytest.approx(-deg, abs=1)


def test_a_bias_across_the_way_is_no_pitch() -> None:
    up = replace(slow(), v_B_mps=slow().v_B_mps + np.array([0, 0, 0.07]))
    assert [fault.name for fault in faults_in(up)] == []


def test_a_lever_that_is_off_is_no_turn_of_the_camera_at_walking_speed() -> None:
    """Turning, a camera half a metre off goes as if it looked elsewhere."""
    T = slow().T_CB
    arm = np.array([0.6, 0.3, 0.5])
    moved = replace(slow(), v_B_mps=slow().v_B_mps - np.cross(slow().w_B_radps, arm))
    right = moved.with_extrinsic(T._replace(p=T.p - T.R @ arm))
    assert [fault.name for fault in faults_in(right)] == []
    for wrong in (-right.T_CB.p, -T.R.T @ right.T_CB.p):
        named = faults_in(moved.with_extrinsic(T._replace(p=wrong)))
        assert [fault.name for fault in named] == ["lever"]


@pytest.mark.parametrize("off", ["the sign", "the camera's position"])
def test_a_wrong_lever_is_not_told_as_a_turned_extrinsic(off: str) -> None:
    """Such a one turns the way of the camera by 10 degrees, and was told as an extrinsic. How far
    both agree is asked once, though both rules want to know: it takes longer than all the rest.
    """
    moved = slow().with_header(noise=driven().header.noise)
    arm = np.array([0.3, 0.1, 0.2])
    T = moved.T_CB
    v = moved.v_B_mps - np.cross(moved.w_B_radps, arm)
    right = T.p - T.R @ arm
    wrong = T._replace(p=-right if off == "the sign" else -T.R.T @ right)
    asked = []

    def counted(recording: Recording, views: TwoViews, seen: CameraMotion) -> Agreement:
        asked.append(1)
        return agreement(recording, views, seen)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry, "agreement", counted)
        named = faults_in(replace(moved, v_B_mps=v).with_extrinsic(wrong))
    assert [fault.name for fault in named] == ["lever"]
    assert len(asked) == 1


@pytest.mark.parametrize("seed", draws([1, 2, 3]))
def test_a_gyros_noise_moves_no_lever(seed: int) -> None:
    """What turns with a noisy gyro seemed to turn less, as if the camera sat nearer to the body."""
    noisy = replace(DRIVE, seed=seed, duration_s=40.0, twist_rate_hz=10.0, gyro_sigma_radps=0.1)
    recording = simulate(noisy).recording
    found = agreed(recording)
    sigma = np.sqrt(np.diag(found.lever_covariance))
    assert (np.abs(found.lever_m) < 4 * sigma + 0.05).all()
    assert [fault.name for fault in faults_in(recording)] == []


@pytest.mark.parametrize(("speed", "due"), [(15.0, []), (1.0, ["lever"])])
def test_tyres_that_slip_are_no_wrong_lever(speed: float, due: list[str]) -> None:
    """On a road at 15 m/s the camera seemed to be 1.5 m farther back, and a good lever was called
    a camera's position in its place.
    """
    car = driven()
    v = np.tile([speed, 0.0, 0.0], (len(car.v_B_mps), 1))
    R = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
    car = replace(car, v_B_mps=v).with_extrinsic(
        car.T_CB._replace(R=R, p=-R @ np.array([1.58, 0.0, 0.65]))
    )
    found = replace(
        agreed(driven()),
        lever_m=np.array([-1.55, 0.29, -0.15]),
        lever_covariance=np.diag([0.29, 0.36, 0.8]) ** 2,
    )
    assert [fault.name for fault in of_lever(car, found)] == due


@pytest.mark.parametrize(("ways_sigma_s", "said"), [(0.1, True), (0.01, False)])
def test_where_velocities_tell_no_clock_it_may_be_the_gyros(
    ways_sigma_s: float, said: bool
) -> None:
    clocks = TwoClocks(0.15, ways_sigma_s, 0.0, 0.1)
    found = replace(agreed(driven()), offset_s=0.15, offset_sigma_s=0.02, clocks=clocks)
    (clock,) = of_clock(driven(), found)
    assert clock.name == "clock"
    assert ("or the rates of turn alone" in clock.words) == said


@pytest.mark.parametrize("seed", draws(range(5)))
def test_axes_that_hardly_turn_are_told_from_mirrored_ones(seed: int) -> None:
    """As of a car on a road, in ten seconds. What is far from the given axes and nearer to the
    others was not named unless it was far from the middle of both, too.
    """
    chance = np.random.default_rng(seed)
    smooth = np.exp(-0.5 * (np.arange(-15, 16) / 2.5) ** 2)
    smooth /= np.linalg.norm(smooth)
    spread = (0.012, 0.01, 0.1)
    w = np.stack([np.convolve(chance.normal(0, x, 130), smooth, "valid") for x in spread], axis=1)
    seen = w + chance.normal(0, 0.005, w.shape)
    told = w + chance.normal(0, 0.005, w.shape)
    assert not MotionPairs(seen, told).alone().won
    mirrored = MotionPairs(seen, told * [-1, -1, 1]).alone()
    assert mirrored.won
    assert np.array_equal(np.diag(mirrored.F), [-1, -1, 1])


def test_a_moving_scene_of_few_tracks_must_move_more_than_chance_has_it() -> None:
    assert Moving(1000, 0.0).least == pytest.approx(0.145, abs=0.005)
    assert Moving(19, 0.0).least == pytest.approx(0.30, abs=0.01)


def test_the_cameras_place_is_found_from_turns() -> None:
    recording = driven()
    T = recording.T_CB
    found = agreed(recording.with_extrinsic(T._replace(p=T.p - T.R @ np.array([0.3, -0.2, 0.0]))))
    sigma = np.sqrt(np.diag(found.lever_covariance))
    assert (np.abs(found.lever_m - np.array([-0.3, 0.2, 0.0])) < 4 * sigma + 0.03).all()
    assert (sigma[:2] < 0.1).all()


@pytest.mark.parametrize("size", [1.0, 1e3, 1e6, 1e8])
def test_a_point_of_unknown_depth_has_no_negative_d2(size: float) -> None:
    """By minors and a determinant half of those of a million pixels had."""
    chance = np.random.default_rng(1)
    u, v = chance.normal(0, 1, (2, 3, 2000))
    J = u[:, None] * v[None] * size + chance.normal(0, 1, (3, 3, 2000))
    S = np.einsum("ijn,jk,lkn->iln", J, NOISE, J) + NOISE[:, :, None]
    e = chance.normal(0, 1, (3, 2000))
    W = inverse((S + S.swapaxes(0, 1)) / 2)
    assert np.einsum("in,ijn,jn->n", e, W, e).min() >= 0
    if size <= 1e3:
        assert np.allclose(np.einsum("ijn,jkn->nik", W, S), np.eye(3), atol=1e-6)


@pytest.mark.parametrize("seed", draws([9429, 9618, 9411]))
def test_at_an_even_speed_a_scale_is_known_as_well_as_a_bias(seed: int) -> None:
    """0.107 +- 0.183, 0.043 +- 0.038 and 1.136 +- 0.205 times the way were told: a weak instrument
    takes the scale to zero, or anywhere.
    """
    found = agreed(everyday_drive(drawn(seed), seed))
    assert found.scale == found.through_zero
    assert found.scale_sigma > 0.1 / found.speed_mps
    assert abs(found.scale - 1) < 2 * found.scale_sigma


@pytest.mark.parametrize(
    ("seed", "why"),
    [
        (9503, "disparities hardly more than their noise: 0.962 +- 0.008 times the way"),
        (9543, "velocities that hardly vary: a clock of their own, 139 +- 22 ms"),
    ],
)
def test_noise_is_no_fault(seed: int, why: str) -> None:
    assert faults_in(everyday_drive(drawn(seed), seed)) == [], why


def test_noisy_ways_do_not_hide_what_turns_tell_of_the_clock() -> None:
    """A rover at an even speed whose velocities are known to 0.3 m/s: 90 ms were not asked for."""
    change, _ = OF_RECORDINGS["clock"]
    late = change(everyday_drive(drawn(9705), 9705), 2)
    assert [fault.name for fault in faults_in(late)] == ["clock"]
