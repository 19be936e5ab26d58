# SPDX-License-Identifier: MIT
"""Reads calibrations of every kind, which their contents tell apart.

JSON of a rectified pair is the project's own (`calibration`); FORMATS lists those of others.
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
    calibration,
    camera_info,
    camera_lists,
    factory,
    kalibr,
    opencv,
    slam_settings,
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
    def sizes(self) -> list[tuple[int, int]]:
        """Returns widths and heights of the pictures for which it was made; 0 where unknown."""
        own = [(self.header.image_width_px, self.header.image_height_px)]
        return own if self.rig is None else self.rig.sizes

    @property
    def remarks(self) -> tuple[str, ...]:
        return (*self.chosen, *self.imu.remarks)


def is_own(paths: Sequence[Path]) -> bool:
    """Returns whether this is the project's own JSON, of a rectified pair."""
    if len(paths) != 1 or paths[0].suffix.lower() != ".json":
        return False
    content = _content(paths[0])
    return "fx_px" in content or _format_of(content) is None


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
    if any(map(_format_of, contents)):
        return read(paths, name)
    if not all(map(kalibr.is_imu, contents)) or len(contents) > 1:
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
    contents = [(content, _format_of(content)) for content in _contents(paths)]
    files = [content for content, known in contents if known]
    imus = [content for content, known in contents if not known]
    for content in imus:
        if not kalibr.is_imu(content):
            raise ForeignFileError(
                content.path,
                f"is no calibration that is known; {', '.join(one.name for one in FORMATS)} or the "
                "project's JSON is expected; there are: "
                f"{', '.join(content.content) or 'no names'}",
            )
    found = list(dict.fromkeys(known for _, known in contents if known))
    if not found:
        raise ForeignFileError(paths[0], "is of an IMU alone; one of the cameras is expected too")
    if len(found) > 1:
        names = " and ".join(one.name for one in found)
        raise ForeignFileError(paths[0], f"and the others are {names}; files of one are expected")
    if len(files) not in found[0].files:
        expected = f"{' or '.join(map(str, found[0].files))} of {found[0].name} are expected"
        raise ForeignFileError(files[-1].path, f"{len(files)} files of cameras; {expected}")
    rig = found[0].read(files, lens, cameras)
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
        kalibr.is_imu(content) and _format_of(content) is None for content in contents
    )


def with_imu(rig: Rig, paths: Sequence[Path]) -> Rig:
    """Returns the rig on the IMU that one of these files describes."""
    if len(paths) > 1:
        raise ForeignFileError(paths[1], "is the second file of an IMU; one is expected")
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
        return factory.sections(path, words)
    return Named(path, foreign.yaml_words(path, words))


class Format(NamedTuple):
    """A program's calibration, with its possible numbers of files."""

    name: str
    is_one: Callable[[Named], bool]
    read: Callable[[list[Named], LensModel | None, Sequence[str]], Rig]
    files: tuple[int, ...] = (1,)


def _opencv(contents: list[Named], lens: LensModel | None, _: Sequence[str]) -> Rig:
    merged = {name: value for content in contents for name, value in content.content.items()}
    return opencv.stereo(Named(contents[0].path, merged), lens)


# Tested in this order: names that several programs use come last.
FORMATS = (
    Format("Kalibr's camchain", kalibr.is_camchain, lambda c, _, of: kalibr.camchain(c[0], of)),
    Format("sensor.yaml of a camera", kalibr.is_sensor, lambda c, *_: kalibr.pair(*c), (2,)),
    Format(
        "camera_info of ROS",
        camera_info.is_camera_info,
        lambda c, lens, _: camera_info.pair(c[0], c[1], lens),
        (2,),
    ),
    Format("ORB-SLAM's settings", slam_settings.is_orb, lambda c, *_: slam_settings.orb(c[0])),
    Format(
        "VINS-Fusion's configuration",
        slam_settings.is_vins,
        lambda c, *_: slam_settings.vins(c),
        (1, 2, 3),
    ),
    Format(
        "Basalt's calibration",
        camera_lists.is_basalt,
        lambda c, _, of: camera_lists.basalt(c[0], of),
    ),
    Format(
        "OKVIS's configuration",
        camera_lists.is_okvis,
        lambda c, _, of: camera_lists.okvis(c[0], of),
    ),
    Format(
        "SVO's or maplab's rig", camera_lists.is_svo, lambda c, _, of: camera_lists.svo(c[0], of)
    ),
    Format("DepthAI's calibration", factory.is_depthai, lambda c, _, of: factory.depthai(c[0], of)),
    Format("a ZED's .conf", factory.is_zed, lambda c, *_: factory.zed(c[0])),
    Format("OpenCV's stereo calibration", opencv.is_opencv, _opencv, (1, 2)),
)


def _format_of(content: Named) -> Format | None:
    return next((one for one in FORMATS if one.is_one(content)), None)
