# SPDX-License-Identifier: MIT
"""Reads a ZED's factory calibration (SN12345.conf): sections for each resolution, in millimetres.

R = Exp(RX, CV, RZ) turns points of the left camera to the right one, which stands Baseline, TY, TZ
from it: q_R = R q_L - (Baseline, TY, TZ).
"""

from __future__ import annotations

import configparser
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy

from pelorus.io.foreign import ForeignFileError
from pelorus.io.named import Named
from pelorus.math.se3 import Poses
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig

SIZES = {
    "2k": (2208, 1242),
    "fhd1200": (1920, 1200),
    "fhd": (1920, 1080),
    "hd": (1280, 720),
    "svga": (960, 600),
    "vga": (672, 376),
}
RADTAN, RATIONAL = ("k1", "k2", "p1", "p2", "k3"), ("k4", "k5", "k6")


def sections(path: Path, words: str) -> Named:
    """Parses a text with [sections]; names become lower case."""
    parser = configparser.ConfigParser(
        interpolation=None, strict=False, comment_prefixes=("#", ";")
    )
    try:
        parser.read_string(words)
    except configparser.Error as error:
        raise ForeignFileError(path, f"is no .conf: {str(error).splitlines()[0]}") from None
    found = {name.lower(): dict(parser[name]) for name in parser.sections()}
    return Named(path, {name: _numbers(section) for name, section in found.items()})


def _numbers(section: dict[str, str]) -> dict[str, float | str]:
    found: dict[str, float | str] = {}
    for name, word in section.items():
        try:
            found[name] = float(word)
        except ValueError:
            found[name] = word
    return found


def is_conf(content: Named) -> bool:
    """Returns whether it has a ZED's sections."""
    return "stereo" in content and any(f"left_cam_{size}" in content for size in SIZES)


def read(content: Named) -> Rig:
    """Returns the rig of each resolution; the pictures' size selects one."""
    there = [
        size for size in SIZES if f"left_cam_{size}" in content and f"right_cam_{size}" in content
    ]
    if not there:
        raise ForeignFileError(content.path, "has no resolution with a left and a right camera")
    rigs = [_rig(content, size) for size in there]
    return replace(rigs[0], others=tuple(rigs[1:]))


def _rig(content: Named, size: str) -> Rig:
    stereo = content.object("stereo")

    def number(name: str) -> float:
        own = f"{name}_{size}"
        return stereo.number(own if own in stereo else name)

    def of(name: str) -> float:
        return number(name) if name in stereo or f"{name}_{size}" in stereo else 0.0

    R = scipy.spatial.transform.Rotation.from_rotvec(
        [number("rx"), number("cv"), number("rz")]
    ).as_matrix()
    T = Poses(R, -1e-3 * np.array([number("baseline"), of("ty"), of("tz")]))
    left, right = (_lens(content, side, size) for side in ("left", "right"))
    return Rig.of_cameras(content.path, left, right, T)


def _lens(content: Named, side: str, size: str) -> Lens:
    camera = content.object(f"{side}_cam_{size}")
    fx, fy, cx, cy = (camera.number(name) for name in ("fx", "fy", "cx", "cy"))
    holder = content.object(f"{side}_disto") if f"{side}_disto" in content else camera
    names = RADTAN + RATIONAL if any(name in holder for name in RATIONAL) else RADTAN
    D = tuple(holder.number(name) if name in holder else 0.0 for name in names)
    model = LensModel.RADTAN if any(D) else LensModel.NONE
    return Lens(model, (fx, fy, cx, cy), D if any(D) else (), *SIZES[size])
