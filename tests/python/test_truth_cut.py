# SPDX-License-Identifier: MIT
"""Truths that begin before the sensors or a little after, with rounded stamps, or elsewhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imu_drives import noisy
from pelorus.converters.streams import Pictures, RawTracks, Readings, Streams, recording
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.io.trajectory import Trajectory
from pelorus.rig.read import Calibrated

DAY_NS = 1_600_000_000 * 10**9


def streams(drive: Recording, truth: Trajectory) -> Streams:
    frames = RawTracks(Path("stereo.csv"), drive.frame_t_ns + DAY_NS, drive.tracks)
    inertial = drive.inertial._replace(t_ns=drive.inertial.t_ns + DAY_NS)
    motion = Readings(Path("imu.csv"), inertial)
    return Streams(Calibrated(drive.header), frames, motion, truth)


def truth_of(drive: Recording, begins_s: float, unit_ns: int, every_ns: int) -> Trajectory:
    """The drive's poses from that time on, s before or behind the first reading."""
    whole = Trajectory(drive.truth_t_ns, drive.truth)
    first = int(drive.inertial.t_ns[0]) + round(begins_s * 1e9)
    t = np.arange(first, int(whole.t_ns[-1]), every_ns)
    held = np.clip(np.searchsorted(whole.t_ns, t), 0, len(whole.t_ns) - 1)
    rounded = (t + DAY_NS + unit_ns // 2) // unit_ns * unit_ns
    return Trajectory(rounded, whole.poses.at(held))


@pytest.mark.parametrize("begins_s", [-37.5, -0.6])
@pytest.mark.parametrize("unit_ns", [1, 10_000, 1_000_000])
def test_a_truth_that_begins_before_the_sensors_is_cut_to_them(
    begins_s: float, unit_ns: int
) -> None:
    drive = noisy().recording
    made = recording(streams(drive, truth_of(drive, begins_s, unit_ns, 8_300_000)))
    assert made.truth_t_ns[0] == made.inertial.t_ns[0] == drive.inertial.t_ns[0] + DAY_NS
    assert made.truth_t_ns[-1] <= max(made.inertial.t_ns[-1], made.frame_t_ns[-1])
    assert len(made.inertial.t_ns) == len(drive.inertial.t_ns)


@pytest.mark.parametrize(("unit_ns", "late_ns"), [(10_000, 3_700), (1_000_000, 620_000)])
def test_a_truth_whose_first_stamp_was_rounded_up_begins_with_the_sensors(
    unit_ns: int, late_ns: int
) -> None:
    drive = noisy().recording
    truth = truth_of(drive, late_ns * 1e-9, unit_ns, 10_000_000)
    made = recording(streams(drive, truth))
    assert made.truth_t_ns[0] == made.inertial.t_ns[0] == drive.inertial.t_ns[0] + DAY_NS


def test_a_filter_starts_from_a_truth_that_begins_before_the_first_frame(tmp_path: Path) -> None:
    drive = noisy().recording
    whole = streams(drive, truth_of(drive, 0.012, 1, 10_000_000))
    later = drive.frame_t_ns >= drive.inertial.t_ns[0] + 50_000_000
    assert not later.all()  # or the drive would not show it
    first = int(later.argmax())
    kept = drive.tracks.frame >= first
    tracks = type(drive.tracks)(
        int(later.sum()),
        drive.tracks.frame[kept] - first,
        drive.tracks.id[kept],
        drive.tracks.pixels[kept],
    )
    frames = RawTracks(Path("stereo.csv"), drive.frame_t_ns[later] + DAY_NS, tracks)
    made = recording(Streams(whole.calibrated, frames, whole.motion, whole.truth))
    assert made.truth_t_ns[0] == drive.inertial.t_ns[0] + DAY_NS + 12_000_000
    assert made.inertial.t_ns[0] >= made.truth_t_ns[0]
    assert made.write(tmp_path / "x.plr") > 0


def test_a_truth_on_another_clock_is_refused_before_a_picture_is_read() -> None:
    drive = noisy().recording
    truth = truth_of(drive, 0.0, 1, 10_000_000)
    other = truth._replace(t_ns=truth.t_ns - DAY_NS)

    def pixels() -> None:
        raise AssertionError("a picture is read")

    frames = Pictures((Path("l"), Path("r")), drive.frame_t_ns + DAY_NS, pixels)  # type: ignore[arg-type]
    whole = streams(drive, other)
    with pytest.raises(PelorusError, match=r"the truth spans .* they do not overlap"):
        recording(Streams(whole.calibrated, frames, whole.motion, other))
