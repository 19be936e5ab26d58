# SPDX-License-Identifier: MIT
"""Calibrations of every kind, told apart by what is in them.

JSON            the project's own, of a rectified pair (pelorus.calibration)
camchain        Kalibr's, with an IMU or without; its IMU file beside it
OpenCV          stereo calibration, in one file or in two
sensor.yaml     those of an EuRoC folder's two cameras and of its IMU
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pelorus import calibration, foreign
from pelorus.foreign import ForeignFileError
from pelorus.frames import Header, Noise
from pelorus.named import Named
from pelorus.rig import kalibr, opencv
from pelorus.rig.lens import LensModel
from pelorus.rig.rig import Rig

KNOWN = (
    "Kalibr's camchain (cam0, cam1), its IMU file (gyroscope_noise_density), OpenCV's stereo "
    "calibration (K1, D1, K2, D2, R, T), a sensor.yaml (T_BS, intrinsics) or the project's JSON"
)


@dataclass(frozen=True)
class Calibrated:
    """The HEADER, and the cameras as they are where the calibration is not of a rectified pair."""

    header: Header
    rig: Rig | None = None
    imu: Noise = field(default_factory=Noise)
    remarks: tuple[str, ...] = ()


def is_own(paths: Sequence[Path]) -> bool:
    """Whether this is the project's own JSON, of a rectified pair."""
    return len(paths) == 1 and paths[0].suffix.lower() == ".json"


def read(
    paths: Sequence[Path],
    name: str,
    extrinsic: Path | None = None,
    lens: LensModel | None = None,
) -> Calibrated:
    """`extrinsic` says where the left camera sits on the body, whatever the other files say."""
    if is_own(paths):
        header = calibration.read(paths[0])
        if extrinsic is not None:
            T = calibration.read_extrinsic(extrinsic)
            header = replace(header, R_CB=T.R, t_CB_m=T.p)
        return Calibrated(header)
    return of_rig(read_rig(paths, lens), name, extrinsic)


def of_rig(rig: Rig, name: str, extrinsic: Path | None = None) -> Calibrated:
    """What a rig says."""
    if extrinsic is not None:
        rig = rig.on_body(calibration.read_extrinsic(extrinsic))
    header = rig.header(rig.rectification(), name)
    return Calibrated(header, None if rig.is_rectified else rig, rig.imu)


def read_rig(paths: Sequence[Path], lens: LensModel | None = None) -> Rig:
    """What one file or several say together."""
    contents = [Named(path, foreign.yaml_object(path)) for path in paths]
    for content in contents:
        if not any(is_one(content) for is_one in (*CAMERAS, kalibr.is_imu)):
            raise ForeignFileError(
                content.path,
                "is no calibration that is known",
                due=f"{KNOWN} is due; there are: {', '.join(content.content) or 'no names'}",
            )
    cameras = [content for content in contents if any(is_one(content) for is_one in CAMERAS)]
    imus = [content for content in contents if content not in cameras]
    if not cameras:
        raise ForeignFileError(paths[0], "is of an IMU alone", due="one of the cameras is due too")
    rig = _cameras(cameras, lens)
    if len(imus) > 1:
        raise ForeignFileError(imus[1].path, "is the second file of an IMU", due="one is due")
    return replace(rig, imu=kalibr.imu(imus[0])) if imus else rig


def _cameras(contents: list[Named], lens: LensModel | None) -> Rig:
    first = contents[0]
    if kalibr.is_camchain(first):
        _require_count(contents, 1, "camchain")
        return kalibr.camchain(first)
    if kalibr.is_sensor(first):
        _require_count(contents, 2, "sensor.yaml of a camera")
        return kalibr.pair(*contents)
    merged = {name: value for content in contents for name, value in content.content.items()}
    return opencv.stereo(Named(first.path, merged), lens)


def _require_count(contents: list[Named], due: int, what: str) -> None:
    if len(contents) != due:
        raise ForeignFileError(
            contents[-1].path, f"{len(contents)} files of cameras", due=f"{due} {what} is due"
        )


CAMERAS = (kalibr.is_camchain, kalibr.is_sensor, opencv.is_opencv)
