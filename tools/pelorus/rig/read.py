# SPDX-License-Identifier: MIT
"""Reads calibrations of every kind, which their contents tell apart.

JSON of a rectified pair is the project's own (`calibration`); KINDS lists those of others.
Kalibr's file of an IMU may accompany any of them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.rig import (
    basalt,
    calibration,
    camera_info,
    depthai,
    kalibr,
    okvis,
    opencv,
    orb_slam,
    svo,
    vins,
    zed,
)
from pelorus.rig.imu_model import ImuModel
from pelorus.rig.lens import LensModel
from pelorus.rig.rig import Rig
from pelorus.wire.frames import Camera, Header, header_name

SECTION = re.compile(r"\[\w+\]\s*$")

# In OpenVINS' estimator_config.yaml: names of Kalibr's files.
ELSEWHERE = ("relative_config_imucam", "relative_config_imu")

NO_CAMERA = Camera(fx_px=1.0, fy_px=1.0, cx_px=0.0, cy_px=0.0, baseline_m=1.0)


@dataclass(frozen=True)
class Calibrated:
    """The HEADER, and the raw cameras where the calibration is not of a rectified pair."""

    header: Header
    rig: Rig | None = None
    imu: ImuModel = field(default_factory=ImuModel)
    chosen: tuple[str, ...] = ()  # remarks on the choice of cameras

    @property
    def remarks(self) -> tuple[str, ...]:
        return (*self.chosen, *self.imu.remarks)


def is_own(paths: Sequence[Path]) -> bool:
    """Returns whether this is the project's own JSON, of a rectified pair."""
    if len(paths) != 1 or paths[0].suffix.lower() != ".json":
        return False
    content = _content(paths[0])
    return not any(kind.is_one(content) for kind in KINDS)


def read(
    paths: Sequence[Path],
    name: str,
    extrinsic: Path | None = None,
    lens: LensModel | None = None,
    cameras: Sequence[str] = (),
) -> Calibrated:
    """Reads a calibration.

    `extrinsic` replaces the left camera's place on the body in the other files; `cameras` names two
    where a file has more.
    """
    if is_own(paths):
        header = calibration.read(paths[0])
        if extrinsic is not None:
            T = calibration.read_extrinsic(extrinsic)
            header = replace(header, R_CB=T.R, t_CB_m=T.p)
        return Calibrated(header)
    return of_rig(read_rig(paths, lens, cameras), name, extrinsic)


def without_cameras(paths: Sequence[Path], name: str) -> Calibrated:
    """Returns the calibration of a recording without pictures: an IMU's file, or none.

    The HEADER's camera is a placeholder. A file with cameras is accepted, too; they are of no use
    then.
    """
    if is_own(paths):
        return read(paths, name)
    contents = _contents(paths)
    if any(kind.is_one(content) for content in contents for kind in KINDS):
        return read(paths, name)
    if any(not kalibr.is_imu(content) for content in contents) or len(contents) > 1:
        raise ForeignFileError(paths[-1], "is no IMU's file, or a second one; one is expected")
    imu = kalibr.imu(contents[0]) if contents else ImuModel()
    return Calibrated(Header(NO_CAMERA, name=header_name(name)), imu=imu)


def of_rig(rig: Rig, name: str, extrinsic: Path | None = None) -> Calibrated:
    """Returns the calibration of a rig."""
    if extrinsic is not None:
        rig = rig.on_body(calibration.read_extrinsic(extrinsic))
    header = rig.header(rig.rectification(), name)
    plain = rig.is_rectified and not rig.offset_s and not rig.others
    return Calibrated(header, None if plain else rig, rig.imu, rig.remarks)


def read_rig(
    paths: Sequence[Path], lens: LensModel | None = None, cameras: Sequence[str] = ()
) -> Rig:
    """Returns the rig that one file or several describe together."""
    contents = _contents(paths)
    kinds = [next((kind for kind in KINDS if kind.is_one(one)), None) for one in contents]
    for content, kind in zip(contents, kinds, strict=True):
        if kind is None and not kalibr.is_imu(content):
            raise ForeignFileError(
                content.path,
                "is no calibration that is known",
                expected=f"{', '.join(kind.name for kind in KINDS)} or the project's JSON is "
                f"expected; there are: {', '.join(content.content) or 'no names'}",
            )
    found = [kind for kind in kinds if kind is not None]
    if not found:
        raise ForeignFileError(paths[0], "is of an IMU alone; one of the cameras is expected too")
    if any(kind is not found[0] for kind in found):
        names = " and ".join(dict.fromkeys(kind.name for kind in found))
        raise ForeignFileError(paths[0], f"and the others are {names}; files of one are expected")
    files = [content for content, kind in zip(contents, kinds, strict=True) if kind is not None]
    if len(files) not in found[0].files:
        expected = " or ".join(map(str, found[0].files))
        raise ForeignFileError(
            files[-1].path,
            f"{len(files)} files of cameras; {expected} of {found[0].name} are expected",
        )
    rig = found[0].read(files, lens, cameras)
    imus = [content for content, kind in zip(contents, kinds, strict=True) if kind is None]
    if len(imus) > 1:
        raise ForeignFileError(imus[1].path, "is the second file of an IMU; one is expected")
    return kalibr.with_imu(rig, imus[0]) if imus else rig


def topics(paths: Sequence[Path]) -> set[str]:
    """Returns the topics of pictures that these files name."""
    return {topic for content in _contents(paths) for topic in kalibr.topics(content)}


def are_of_imu(paths: Sequence[Path]) -> bool:
    """Returns whether these files are of an IMU alone, without cameras."""
    contents = _contents(paths)
    return bool(contents) and all(
        kalibr.is_imu(content) and not any(kind.is_one(content) for kind in KINDS)
        for content in contents
    )


def with_imu(rig: Rig, paths: Sequence[Path]) -> Rig:
    """Returns the rig on the IMU that one of these files describes."""
    if len(paths) > 1:
        raise ForeignFileError(paths[1], "is the second file of an IMU", expected="one is expected")
    return kalibr.with_imu(rig, _content(paths[0]))


def _contents(paths: Sequence[Path]) -> list[Named]:
    """Returns the contents of the files; of one that only names others, those of the others."""
    found: list[Named] = []
    for path in paths:
        content = _content(path)
        named = [str(content.content[name]) for name in ELSEWHERE if name in content]
        found += [_content(path.parent / name) for name in named] if named else [content]
    return found


def _content(path: Path) -> Named:
    """Returns the names in a file, by its format: JSON, XML, sections, else YAML."""
    words = foreign.text(path, foreign.JSON_BYTES_MAX).lstrip()
    if path.suffix.lower() == ".json":
        return Named(path, foreign.json_words(path, words))
    if words.startswith("<"):
        return Named(path, opencv.xml_words(path, words))
    lines = (line for line in words.splitlines() if line.strip() and line[0] not in "#;")
    if SECTION.match(next(lines, "")):
        return zed.sections(path, words)
    return Named(path, foreign.yaml_words(path, words))


class CalibrationKind(NamedTuple):
    """A program's calibration, with its number of files."""

    name: str
    is_one: Callable[[Named], bool]
    files: tuple[int, ...]
    read: Callable[[list[Named], LensModel | None, Sequence[str]], Rig]


def _opencv(contents: list[Named], lens: LensModel | None, _: Sequence[str]) -> Rig:
    merged = {name: value for content in contents for name, value in content.content.items()}
    return opencv.stereo(Named(contents[0].path, merged), lens)


# Tested in this order: names that several programs use come last.
KINDS = (
    CalibrationKind(
        "Kalibr's camchain", kalibr.is_camchain, (1,), lambda c, _, of: kalibr.camchain(c[0], of)
    ),
    CalibrationKind(
        "sensor.yaml of a camera", kalibr.is_sensor, (2,), lambda c, *_: kalibr.pair(*c)
    ),
    CalibrationKind(
        "camera_info of ROS",
        camera_info.is_camera_info,
        (2,),
        lambda c, lens, _: camera_info.pair(c[0], c[1], lens),
    ),
    CalibrationKind(
        "ORB-SLAM's settings", orb_slam.is_settings, (1,), lambda c, *_: orb_slam.read(c[0])
    ),
    CalibrationKind(
        "VINS-Fusion's configuration",
        lambda content: vins.is_config(content) or vins.is_camera(content),
        (1, 2, 3),
        lambda c, *_: vins.read(c),
    ),
    CalibrationKind(
        "Basalt's calibration", basalt.is_calibration, (1,), lambda c, _, of: basalt.read(c[0], of)
    ),
    CalibrationKind(
        "OKVIS's configuration", okvis.is_config, (1,), lambda c, _, of: okvis.read(c[0], of)
    ),
    CalibrationKind("SVO's or maplab's rig", svo.is_rig, (1,), lambda c, _, of: svo.read(c[0], of)),
    CalibrationKind(
        "DepthAI's calibration",
        depthai.is_calibration,
        (1,),
        lambda c, _, of: depthai.read(c[0], of),
    ),
    CalibrationKind("a ZED's .conf", zed.is_conf, (1,), lambda c, *_: zed.read(c[0])),
    CalibrationKind("OpenCV's stereo calibration", opencv.is_opencv, (1, 2), _opencv),
)
