# SPDX-License-Identifier: MIT
"""A user's own data: CSV files with a row of column names, in any order, and a calibration.

twists   t_s or t_ns, vx_mps, vy_mps, vz_mps, wx_radps, wy_radps, wz_radps
stereo   t_s or t_ns, id, uL_px, vL_px, uR_px, vR_px; the rows of one time are one frame
truth    t_s or t_ns, px_m, py_m, pz_m, qx, qy, qz, qw: body to world (optional)

And those of small sensors: readings_csv.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pelorus.converters import readings_csv, twist_noise
from pelorus.faults.finding import Finding
from pelorus.faults.mend import mend
from pelorus.foreign import ForeignFileError
from pelorus.frames import Reading, TwistTiming
from pelorus.motion import Times
from pelorus.recording import Recording
from pelorus.rig import read as rig_files
from pelorus.rig.lens import LensModel
from pelorus.rig.rig import Rig
from pelorus.se3 import Poses
from pelorus.small_sensors import SMALL_SENSORS
from pelorus.table import Table
from pelorus.tracks import Tracks

ID_MAX = 2**32 - 1
QUATERNION_NORM_TOLERANCE = 1e-2


@dataclass(frozen=True)
class Sources:
    """The files of one recording; `calibration`, `extrinsic` and `lens` as rig.read has them."""

    twists: Path
    stereo: Path
    calibration: tuple[Path, ...]
    truth: Path | None = None
    extrinsic: Path | None = None
    lens: LensModel | None = None


def convert(
    sources: Sources,
    fix: bool = True,
    twist_timing: TwistTiming | None = None,
    readings: Mapping[str, list[Path]] | None = None,
) -> tuple[Recording, list[Finding]]:
    """Read; mend and measure the noise if asked. `twist_timing` overrides the calibration's.

    `readings` are the files of small sensors, by name.
    """
    recording = read(sources, readings or {})
    if twist_timing is not None:
        recording = recording.with_header(twist_timing=twist_timing)
    if not fix:
        return recording, []
    recording, findings = mend(recording)
    recording, finding = twist_noise.suggest(recording)
    return recording, [*findings, finding]


def read(sources: Sources, readings: Mapping[str, list[Path]]) -> Recording:
    """The files as they are."""
    calibrated = rig_files.read(
        sources.calibration, sources.stereo.stem, sources.extrinsic, sources.lens
    )
    twists = Table.read(sources.twists)
    v = twists.numbers("vx_mps", "vy_mps", "vz_mps")
    w = twists.numbers("wx_radps", "wy_radps", "wz_radps")
    twist_t_ns = twists.ascending_times()
    frame_t_ns, tracks = _stereo(sources.stereo)
    if calibrated.rig is not None:
        frame_t_ns = calibrated.rig.on_body_clock(frame_t_ns)
        tracks = rectified(tracks, calibrated.rig, sources.stereo)
    if frame_t_ns[-1] < twist_t_ns[0] or twist_t_ns[-1] < frame_t_ns[0]:
        raise ForeignFileError(
            sources.stereo,
            f"spans {frame_t_ns[0]} to {frame_t_ns[-1]} ns, {sources.twists} "
            f"{twist_t_ns[0]} to {twist_t_ns[-1]} ns: they do not overlap",
        )
    recording = Recording(
        calibrated.header,
        twist_t_ns,
        v,
        w,
        frame_t_ns,
        tracks,
        readings=_readings(readings, sources, twist_t_ns),
    )
    if sources.truth is None:
        return recording
    truth_t_ns, truth = _truth(sources.truth)
    return recording.with_truth(truth_t_ns, truth)


def _readings(
    paths: Mapping[str, list[Path]], sources: Sources, twist_t_ns: Times
) -> list[Reading]:
    """Of all small sensors, from the first twist on: with it the filter begins."""
    found: list[Reading] = []
    files = [(sensor, path) for sensor in SMALL_SENSORS for path in paths.get(sensor.name, [])]
    for sensor, path in files:
        own = readings_csv.read(path, sensor)
        first, last = own[0].t_ns, own[-1].t_ns
        if last < twist_t_ns[0] or twist_t_ns[-1] < first:
            raise ForeignFileError(
                path,
                f"spans {first} to {last} ns, {sources.twists} {twist_t_ns[0]} to "
                f"{twist_t_ns[-1]} ns: they do not overlap",
            )
        found += [reading for reading in own if reading.t_ns >= twist_t_ns[0]]
    return found


def _stereo(path: Path) -> tuple[Times, Tracks]:
    table = Table.read(path)
    row_t_ns = table.times()
    frame_t_ns, frame = np.unique(row_t_ns, return_inverse=True)
    id = table.integers("id", ID_MAX)
    pixels = table.numbers("uL_px", "vL_px", "uR_px", "vR_px")
    tracks = Tracks.from_rows(len(frame_t_ns), frame.reshape(-1).astype(np.intp), id, pixels)
    tracks.check(path)
    twice = (np.diff(tracks.frame) == 0) & (np.diff(tracks.id) == 0)
    if twice.any():
        k = int(np.nonzero(twice)[0][0])
        t_ns = frame_t_ns[tracks.frame[k]]
        rows = np.nonzero((row_t_ns == t_ns) & (id == tracks.id[k]))[0] + 2
        raise ForeignFileError(
            path,
            f"id {tracks.id[k]} stands twice in the frame at {t_ns} ns: "
            f"rows {rows[0]} and {rows[1]}",
        )
    return frame_t_ns, tracks


def rectified(tracks: Tracks, rig: Rig, source: Path) -> Tracks:
    """Of the pixels that the cameras took; without those that no ray of the lens reaches."""
    pixels = rig.rectification().pixels(tracks.pixels)
    good = np.isfinite(pixels).all(axis=1)
    if not good.any():
        raise ForeignFileError(
            source,
            f"no pixel is one of the lenses of {rig.path}",
            due="pixels as the cameras took them are due, of that calibration's resolution",
        )
    return Tracks(tracks.frame_count, tracks.frame[good], tracks.id[good], pixels[good])


def _truth(path: Path) -> tuple[Times, Poses]:
    table = Table.read(path)
    t_ns = table.ascending_times()
    quaternions = table.numbers("qx", "qy", "qz", "qw")
    off = np.abs(np.linalg.norm(quaternions, axis=1) - 1)
    if off.max() > QUATERNION_NORM_TOLERANCE:
        raise ForeignFileError(
            path,
            "the quaternion's norm is not 1 (the columns are qx, qy, qz, qw)",
            at=f"row {int(off.argmax()) + 2}",
        )
    return t_ns, Poses(
        Rotation.from_quat(quaternions).as_matrix(), table.numbers("px_m", "py_m", "pz_m")
    )
