# SPDX-License-Identifier: MIT
"""The .mat files: what arrives, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import COUNT, SHORT, Run, messages_of
from drives import clean, mat_arrays
from pelorus.wire.frames import BodyAxes, Header, Landmark, Role, Stereo, Truth, Twist, TwistTiming
from pelorus_course import matlab
from scipy.io import savemat


@pytest.mark.parametrize("time_first", [True, False])
def test_everything_of_a_klt_drive_arrives(tmp_path: Path, pelorus: Run, time_first: bool) -> None:
    drive = clean(**SHORT)
    source, target = tmp_path / "klt.mat", tmp_path / "klt.plr"
    savemat(source, mat_arrays(drive, time_first))
    pelorus("convert", "klt", source, target)
    header = messages_of(target, Header)[0]
    assert np.allclose(header.R_CB, drive.T_CB.R)
    assert np.allclose(header.t_CB_m, drive.T_CB.p)
    assert header.twist_timing is TwistTiming.MID
    assert header.body_axes is BodyAxes.FORWARD_LEFT_UP
    truth, twists = messages_of(target, Truth), messages_of(target, Twist)
    assert np.allclose([m.R_WB for m in truth], drive.truth.R)
    assert np.array_equal([m.p_WB_m for m in truth], drive.truth.p)
    assert np.array_equal([m.v_B_mps for m in twists], drive.v_B_mps)  # the extra ones are cut
    ids = np.concatenate([m.ids for m in messages_of(target, Stereo)])
    assert np.array_equal(ids, drive.tracks.id)


def test_starry_night_brings_its_landmarks_and_its_noise(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    points = np.random.default_rng(1).normal(size=(3, int(drive.tracks.id.max()) + 1))
    noise = {
        "y_var": np.array([[4.0], [16.0], [4.0], [16.0]]),
        "v_var": np.array([[0.01], [0.02], [0.03]]),
        "w_var": np.array([[0.09], [0.04], [0.14]]),
    }
    source, target = tmp_path / "starry.mat", tmp_path / "starry.plr"
    savemat(source, mat_arrays(drive) | noise | {"rho_i_pj_i": points})
    pelorus("convert", "starry-night", source, target, "--landmark-sigma", "0.1")
    header, known = messages_of(target, Header)[0], messages_of(target, Landmark)
    assert header.twist_timing is TwistTiming.START
    assert np.isclose(header.noise.pixel_sigma_px, np.sqrt(10))
    assert np.isclose(header.noise.velocity_sigma_mps, np.sqrt(0.02))
    assert np.isclose(header.noise.gyro_sigma_radps, 0.3)
    assert header.noise.gyro_sigma_z_radps < 0  # one sigma for all axes
    assert [m.id for m in known] == list(range(points.shape[1]))
    assert np.array_equal([m.p_W_m for m in known], points.T)
    assert all(m.role is Role.KNOWN for m in known)
    assert np.allclose(known[0].covariance, [0.01, 0, 0.01, 0, 0, 0.01])
    assert matlab.starry_night(source).known[0].covariance[0] == matlab.LANDMARK_SIGMA_M**2


BAD_MAT = [
    ({"y_k_j": np.zeros((4, 8, 9))}, "4 x 61 x n or 4 x n x 61 is expected"),
    ({"y_k_j": np.zeros((4, COUNT, COUNT))}, "which axis is time"),
    ({"y_k_j": np.zeros((5, COUNT, 9))}, "shape"),
    ({"v_vk_vk_i": np.zeros((3, 5))}, "5 columns for 61 times"),
    ({"C_c_v": np.ones((3, 3))}, "C_c_v is no rotation"),
    ({"rho_v_c_v": np.zeros((3, 2))}, "rho_v_c_v has the shape"),
    ({"fu": -1.0}, "must be positive"),
    ({"theta_vk_i": np.full((3, 80), np.nan)}, "theta_vk_i"),
]


@pytest.mark.parametrize(("changes", "said"), BAD_MAT, ids=[said[:30] for _, said in BAD_MAT])
def test_a_misshapen_mat_is_refused(
    tmp_path: Path, pelorus: Run, changes: dict[str, Any], said: str
) -> None:
    source = tmp_path / "bad.mat"
    savemat(source, mat_arrays(clean(**SHORT)) | changes)
    outcome = pelorus("convert", "klt", source, tmp_path / "out.plr", status=1)
    assert "bad.mat" in outcome.err
    assert said in outcome.err


def test_a_folder_in_place_of_the_file_is_called_so(tmp_path: Path, pelorus: Run) -> None:
    for source in ("klt", "starry-night", "imu-npz", "ece276a"):
        said = pelorus("convert", source, tmp_path, tmp_path / "out.plr", status=1).err
        assert "is a folder; one file of it is expected" in said


def test_starry_night_without_landmarks_is_refused(tmp_path: Path, pelorus: Run) -> None:
    source = tmp_path / "klt.mat"
    arrays = mat_arrays(clean(**SHORT))
    savemat(source, arrays)
    outcome = pelorus("convert", "starry-night", source, tmp_path / "out.plr", status=1)
    assert "lacks the array rho_i_pj_i" in outcome.err
    savemat(source, arrays | {"rho_i_pj_i": np.zeros((3, 2))})
    outcome = pelorus("convert", "starry-night", source, tmp_path / "out.plr", status=1)
    assert "rho_i_pj_i has 2" in outcome.err
    outcome = pelorus(
        "convert", "starry-night", source, tmp_path / "o.plr", "--landmark-sigma", 0, status=1
    )
    assert "must be positive" in outcome.err


def test_what_is_wrong_with_a_drive_is_named(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT | {"duration_s": 8.0})
    arrays = mat_arrays(drive)
    arrays["w_vk_vk_i"] = np.degrees(arrays["w_vk_vk_i"])
    source, target = tmp_path / "klt.mat", tmp_path / "klt.plr"
    savemat(source, arrays)
    said = pelorus("convert", "klt", source, target)
    assert "unit-degrees: FOUND" in said.out
