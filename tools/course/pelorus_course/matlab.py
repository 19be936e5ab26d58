# SPDX-License-Identifier: MIT
"""The .mat files of Starry Night (UTIAS) and of the KITTI KLT drives (Clement et al., CRV 2015).

`y_k_j` (4, T, M) or (4, M, T) px in the order uL vL uR vR, -1 where absent; `v_vk_vk_i`,
`w_vk_vk_i` (3, T'); `t` (1, T) s; `theta_vk_i` (3, T') rad, R_WB = Exp(theta); `r_i_vk_i` (3, T')
m; `fu fv cu cv b`; `C_c_v` (3, 3) body to camera; `rho_v_c_v` (3, 1) the camera's position in the
body, so T_CB = [C_c_v | -C_c_v rho]. T' may exceed T. Starry Night has `rho_i_pj_i` (3, n), the
landmarks, and the noise variances `w_var v_var y_var` too.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy
from pelorus.errors import PelorusError
from pelorus.io import arrays
from pelorus.io.arrays import Arrays
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.math.axes import body_axes
from pelorus.math.se3 import Poses
from pelorus.wire.frames import Header, Landmark, Noise, Role, TwistTiming, header_name
from pelorus.wire.layout import Floats

from pelorus_course.mat import read_mat

LANDMARK_SIGMA_M = 0.01  # Starry Night's map was surveyed by motion capture


def starry_night(
    source: Path,
    twist_timing: TwistTiming = TwistTiming.START,
    landmark_sigma_m: float = LANDMARK_SIGMA_M,
) -> Recording:
    """Reads a drive with the noise variances of the file and its landmarks as LANDMARK(known)."""
    file = read_mat(source)
    recording = _read(file, twist_timing)
    if not 0 < landmark_sigma_m < np.inf:
        raise PelorusError(f"landmark sigma {landmark_sigma_m} m: must be positive")
    points = file.get("rho_i_pj_i", shape=(3, None)).T
    highest = int(recording.tracks.id.max())
    if highest >= len(points):
        raise ForeignFileError(
            source, f"y_k_j shows {highest + 1} landmarks, rho_i_pj_i has {len(points)}"
        )
    covariance = landmark_sigma_m**2 * np.array([1.0, 0, 1, 0, 0, 1])
    known = [Landmark(k, p, covariance, Role.KNOWN) for k, p in enumerate(points)]
    return replace(recording.with_header(noise=_noise(file)), known=known)


def klt(source: Path, twist_timing: TwistTiming = TwistTiming.MID) -> Recording:
    """Reads a drive with the OXTS poses of the file as TRUTH."""
    return _read(read_mat(source), twist_timing)


def _read(file: Arrays, twist_timing: TwistTiming) -> Recording:
    t_ns = arrays.nanoseconds(file.path, "t", file.get("t").ravel())
    count = len(t_ns)
    fx, fy, cx, cy = (file.scalar(key) for key in ("fu", "fv", "cu", "cv"))
    camera = arrays.camera_of(file.path, fx, fy, cx, cy, file.scalar("b"))
    R_CB = arrays.rotation(file.path, "C_c_v", file.get("C_c_v", shape=(3, 3)))
    t_CB = -R_CB @ file.get("rho_v_c_v", shape=(3, 1)).ravel()
    tracks = Tracks.from_dense(_features(file, count))
    tracks.check(file.path)
    rotation_vectors, position = (_first(file, key, count) for key in ("theta_vk_i", "r_i_vk_i"))
    header = Header(
        camera,
        R_CB,
        t_CB,
        body_axes=body_axes(R_CB),
        twist_timing=twist_timing,
        name=header_name(file.path.stem),
    )
    v, w = (_first(file, key, count) for key in ("v_vk_vk_i", "w_vk_vk_i"))
    turns = scipy.spatial.transform.Rotation.from_rotvec(
        rotation_vectors.copy()
    )  # it refuses read-only arrays
    truth = Poses(turns.as_matrix(), position)
    return Recording(header, t_ns, v, w, t_ns, tracks, t_ns, truth)


def _first(file: Arrays, key: str, count: int) -> Floats:
    """Returns the first (count, 3) of a (3, T') array, T' >= count."""
    array = file.get(key, shape=(3, None))
    if array.shape[1] < count:
        raise ForeignFileError(
            file.path, f"{key} has {array.shape[1]} columns for {count} times in t"
        )
    return array[:, :count].T


def _features(file: Arrays, count: int) -> Floats:
    """Returns (4, M, T) features, whichever axis order the file has."""
    y = file.get("y_k_j", shape=(4, None, None))
    if y.shape[1] == y.shape[2] == count:
        raise ForeignFileError(file.path, f"y_k_j is 4 x {count} x {count}: which axis is time?")
    if y.shape[1] == count:
        return np.swapaxes(y, 1, 2)
    if y.shape[2] == count:
        return y
    raise ForeignFileError(
        file.path,
        f"y_k_j has the shape {y.shape}, but t has {count} times; 4 x {count} x n or 4 x n x "
        f"{count} is expected",
    )


def _noise(file: Arrays) -> Noise:
    """Returns the sigmas: roots of the means of w_var (angular), v_var (linear), y_var (pixels).

    One for all axes: w_var is largest about the axis that turned most. The readings are late, so
    their error is where the rate changes, and that can be about any axis (docs/MATH.md 17).
    """
    variances = {key: file.get(key).ravel() for key in ("y_var", "v_var", "w_var")}
    for key, variance in variances.items():
        if not variance.size or not (variance >= 0).all():
            raise ForeignFileError(
                file.path, f"{key} is {variance}; variances that are not negative are expected"
            )
    return Noise(*(float(np.sqrt(np.mean(variance))) for variance in variances.values()))
