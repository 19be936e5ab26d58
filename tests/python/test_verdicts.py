# SPDX-License-Identifier: MIT
"""A slice of tests/recordings/verdicts.py, and each kind of drive that was accused wrongly, or of
the wrong cause, with numbers of its own.
"""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import draws
from everyday import drawn
from everyday import drive as everyday_drive
from injected import found_in, injections
from pelorus.converters.streams import Twists, converted, recording
from pelorus.faults.fault import UNTOLD
from pelorus.faults.named import faults_in
from pelorus.io.recording import Recording
from pelorus.math import se3
from robots import BY_IMU, KINDS, WHOLE, drive

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "recordings"))
import verdicts


@pytest.mark.parametrize(("kind", "by"), [(kind, by) for kind in KINDS for by in (WHOLE, BY_IMU)])
def test_clean_robots_are_accused_of_nothing(kind: str, by: str) -> None:
    assert verdicts.found_in(drive(kind, by, 71))[1] == []


@pytest.mark.parametrize(
    ("kind", "by", "seed"),
    [("stop and go", BY_IMU, 918), ("rover", BY_IMU, 954), ("rover", WHOLE, 20116)],
)
def test_what_a_drive_does_not_tell_is_no_fault(kind: str, by: str, seed: int) -> None:
    """A lever of 10 m along the axis of all turns, by instruments that were fitted to noise; a way
    4 % too short, of points whose disparity is three times its noise; axes turned by 90 degrees, at
    an even speed.
    """
    assert verdicts.found_in(drive(kind, by, seed))[1] == []


def test_what_is_estimated_carries_its_ratio_of_likelihoods() -> None:
    """What is read off the file has none."""
    exact = {"ids-rows", "frozen"}
    for name, k, wrong, due in injections(moving(7201)):
        if k == 0 and name not in exact:
            first = found_in(wrong)[0]
            assert first.name in due, name
            assert first.ratio is not None, name
            assert first.ratio > 16, name


def test_what_is_told_no_more_beside_a_fault_is_said() -> None:
    streams = drive("carried", WHOLE, 76).streams
    assert isinstance(streams.motion, Twists)
    wrong = replace(streams.motion, w_B_radps=np.degrees(streams.motion.w_B_radps))
    _, findings = converted(replace(streams, motion=wrong), None, True)
    words = {f.subject: f.evidence for f in findings}
    assert "likelihood ratio" in words["unit-degrees"]
    assert "cannot tell scale, clock and the camera's place" in words["camera and body"]


def test_what_stands_is_told_to_tell_nothing() -> None:
    [said] = faults_in(recording(drive("standing", WHOLE, 72).streams))
    assert said.name == UNTOLD
    assert "stands all along" in said.words


def moving(seed: int) -> Recording:
    return everyday_drive(replace(drawn(seed), kind="rover", told=0), seed)


def test_twists_that_were_never_filled_in_are_named() -> None:
    clean = moving(7201)
    none = np.zeros_like(clean.v_B_mps)
    said = faults_in(replace(clean, v_B_mps=none, w_B_radps=none))
    assert [fault.name for fault in said] == ["twists-zero"]
    assert "only the pose" in said[0].words


@pytest.mark.parametrize("seed", draws([7202, 7205]))
def test_velocities_in_world_axes_are_named_so(seed: int) -> None:
    clean = moving(seed)
    t_ns = clean.twist_t_ns
    world = se3.exp(np.zeros(3), np.array([0.0, 0.0, 0.7])).R
    R = np.stack(
        [np.interp(t_ns, clean.truth_t_ns, x) for x in clean.truth.R.reshape(-1, 9).T], axis=-1
    )
    R_WB = np.stack([se3.nearest_rotation(x) for x in R.reshape(-1, 3, 3)])
    v_W = np.einsum("ij,njk,nk->ni", world, R_WB, clean.v_B_mps)
    said = found_in(replace(clean, v_B_mps=v_W))
    assert said[0].name == "world-axes", said
    assert said[0].ratio is not None
    assert said[0].ratio > 100


def test_no_scale_is_read_across_gaps_and_the_way_in_them_is_told() -> None:
    streams = drive("stop and go", WHOLE, 73).streams
    twists = streams.motion
    assert isinstance(twists, Twists)
    moves = np.linalg.norm(twists.v_B_mps, axis=1) > 0.25 * np.max(np.abs(twists.v_B_mps))
    lost = replace(
        twists, t_ns=twists.t_ns[moves], v_B_mps=twists.v_B_mps[moves],
        w_B_radps=twists.w_B_radps[moves],
    )  # fmt: skip
    said = faults_in(recording(replace(streams, motion=lost)))
    assert {fault.name for fault in said} <= {"time-gap"}


@pytest.mark.parametrize("seed", draws([74, 75]))
def test_wrong_right_pictures_are_no_lever(seed: int) -> None:
    """In a tenth of the pairs the right picture is the one of three frames before."""
    clean = recording(drive("carried", BY_IMU, seed).streams)
    tracks = clean.tracks
    px = tracks.pixels.copy()
    pairs = tracks.pairs(3)
    wrong = np.random.default_rng(seed).random(tracks.frame_count) < 0.11
    stale = wrong[tracks.frame[pairs.second]]
    px[pairs.second[stale], 2:] = tracks.pixels[pairs.first[stale], 2:]
    said = faults_in(replace(clean, tracks=replace(tracks, pixels=px)))
    assert not {fault.name for fault in said} & {"lever", "scale", "axes", "no-fit"}


@pytest.mark.parametrize(
    ("kind", "seed"), draws([("rover", 501), ("drone", 502), ("carried", 503)])
)
def test_velocities_of_another_point_of_the_robot_are_named(kind: str, seed: int) -> None:
    """As of an axle, where the extrinsic counts from the robot's middle. On a level floor nothing
    tells how high it is.
    """
    streams = drive(kind, WHOLE, seed).streams
    twists = streams.motion
    assert isinstance(twists, Twists)
    assert faults_in(recording(streams)) == []
    v_B_mps = twists.v_B_mps + np.cross(twists.w_B_radps, [0.6, 0.0, 0.0])
    [said] = faults_in(recording(replace(streams, motion=replace(twists, v_B_mps=v_B_mps))))
    assert said.name == "lever"
    assert not said.stops
    assert re.search(r"velocities are those of a point at \(0\.(59|60), ", said.words)
    assert ("?" in said.words) == (kind == "rover")
