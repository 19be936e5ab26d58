# SPDX-License-Identifier: MIT
"""A user's own CSV files: what arrives, what is mended, what is refused."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import SHORT, Run, messages_of
from drives import clean, with_turned_axes
from pelorus.converters import csv as csv_converter
from pelorus.converters.streams import converted
from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.io.tracks import project, triangulate
from pelorus.math import se3
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, Header, Stereo, Truth, Twist, TwistTiming
from rigs import Cameras, camchain, write_yaml
from scipy.spatial.transform import Rotation


def write_csv(path: Path, columns: dict[str, Any]) -> Path:
    with path.open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(columns)
        table.writerows(zip(*columns.values(), strict=True))
    return path


def csv_files(folder: Path, recording: Recording) -> list[Any]:
    """The options of `convert csv` for this recording."""
    v, w = recording.v_B_mps.T.tolist(), recording.w_B_radps.T.tolist()
    names = ("vx_mps", "vy_mps", "vz_mps", "wx_radps", "wy_radps", "wz_radps")
    twists = {"t_ns": recording.twist_t_ns.tolist(), **dict(zip(names, v + w, strict=True))}
    tracks = recording.tracks
    shuffled = np.random.default_rng(1).permutation(len(tracks))
    pixels = dict(
        zip(("uL_px", "vL_px", "uR_px", "vR_px"), tracks.pixels[shuffled].T.tolist(), strict=True)
    )
    stereo = {
        **pixels,
        "id": tracks.id[shuffled].tolist(),
        "t_ns": recording.frame_t_ns[tracks.frame[shuffled]].tolist(),
    }
    p, q = (
        recording.truth.p.T.tolist(),
        Rotation.from_matrix(recording.truth.R).as_quat().T.tolist(),
    )
    poses = dict(zip(("px_m", "py_m", "pz_m", "qx", "qy", "qz", "qw"), p + q, strict=True))
    truth = {"t_s": [f"{t / 1e9:.9f}" for t in recording.truth_t_ns], **poses}
    T_BC = se3.inverse(recording.T_CB)
    calibration = vars(recording.header.camera) | {
        "R_BC": T_BC.R.tolist(),
        "t_BC_m": T_BC.p.tolist(),
        "image_width_px": 640,
        "image_height_px": 480,
        "twist_timing": "end",
        "noise": {"pixel_sigma_px": 0.5},
        "name": "mine",
    }
    (folder / "camera.json").write_text(json.dumps(calibration))
    return [
        *("--twists", write_csv(folder / "twists.csv", twists)),
        *("--stereo", write_csv(folder / "stereo.csv", stereo)),
        *("--calibration", folder / "camera.json"),
        *("--truth", write_csv(folder / "truth.csv", truth)),
    ]


def refusal_of_twists(folder: Path, pelorus: Run, change: tuple[str, str]) -> str:
    """What `convert csv` says of a table of twists in which one text stands for another."""
    options = csv_files(folder, clean(**SHORT))
    path = folder / "twists.csv"
    path.write_text(path.read_text().replace(*change))
    said: str = pelorus("convert", "csv", *options, folder / "out.plr", status=1).err
    return said


def convert(sources: csv_converter.Sources, fix: bool = True) -> tuple[Recording, list[Finding]]:
    """What `convert csv` makes of these files."""
    return converted(csv_converter.read(sources, {}), None, fix)


def sources_in(folder: Path) -> csv_converter.Sources:
    """Returns the files that `csv_files` wrote."""
    return csv_converter.Sources(
        csv_converter.MotionFiles(folder / "twists.csv"),
        folder / "stereo.csv",
        (folder / "camera.json",),
    )


def test_a_users_own_csv_arrives_whole(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(twist_rate_hz=50.0, **SHORT)
    target = tmp_path / "mine.plr"
    pelorus("convert", "csv", *csv_files(tmp_path, drive), target)
    header = messages_of(target, Header)[0]
    assert np.allclose(header.R_CB, drive.T_CB.R)
    assert np.allclose(header.t_CB_m, drive.T_CB.p)
    assert header.name == "mine"
    assert header.twist_timing is TwistTiming.END
    assert header.body_axes is BodyAxes.FORWARD_LEFT_UP
    assert (header.image_width_px, header.image_height_px) == (640, 480)
    assert header.noise.pixel_sigma_px == 0.5
    assert header.noise.gyro_sigma_radps < 0
    twists, stereos = messages_of(target, Twist), messages_of(target, Stereo)
    assert [m.t_ns for m in twists] == drive.twist_t_ns.tolist()
    assert np.array_equal([m.w_B_radps for m in twists], drive.w_B_radps)
    assert np.array_equal(np.concatenate([m.ids for m in stereos]), drive.tracks.id)
    pixels = np.concatenate([m.pixels for m in stereos])
    assert np.array_equal(pixels, drive.tracks.pixels.astype(np.float32))
    truth = messages_of(target, Truth)
    assert [m.t_ns for m in truth] == drive.truth_t_ns.tolist()
    assert np.allclose([m.R_WB for m in truth], drive.truth.R)


def test_noise_that_nobody_told_of_is_measured_unless_the_data_are_to_be_left(
    tmp_path: Path,
) -> None:
    csv_files(tmp_path, clean(3, velocity_sigma_mps=0.5, gyro_sigma_radps=0.05))
    sources = sources_in(tmp_path)
    recording, findings = convert(sources)
    noise = next(finding for finding in findings if finding.subject == "twist noise")
    assert noise.measured
    assert recording.header.noise.velocity_sigma_mps == pytest.approx(0.5, rel=0.15)
    assert recording.header.noise.gyro_sigma_radps == pytest.approx(0.05, rel=0.15)
    assert recording.header.noise.pixel_sigma_px == 0.5, "as the calibration says"
    recording, findings = convert(sources, fix=False)
    assert findings == []
    assert recording.header.noise.velocity_sigma_mps < 0


def test_faults_of_a_users_own_data_are_found_too(tmp_path: Path) -> None:
    drive = clean(3)
    csv_files(tmp_path, with_turned_axes(drive))
    sources = sources_in(tmp_path)
    mended, findings = convert(sources)
    assert [f.subject for f in findings if f.found] == ["axes", "clock"], (
        "the calibration says end where the drive was made with start"
    )
    assert "twist-timing start" in findings[-1].evidence
    assert np.allclose(mended.T_CB.R, drive.T_CB.R)
    left, findings = convert(sources, fix=False)
    assert findings == []
    assert np.allclose(left.T_CB.R, with_turned_axes(drive).T_CB.R)


def test_no_extrinsic_is_changed_for_one_that_does_not_fit_either(tmp_path: Path) -> None:
    turned = with_turned_axes(clean(3))
    csv_files(tmp_path, replace(turned, v_B_mps=3.6 * turned.v_B_mps))
    left, findings = convert(sources_in(tmp_path))
    assert np.allclose(left.T_CB.R, turned.T_CB.R)
    told = {finding.subject: finding for finding in findings}
    assert told["unit-km/h"].found
    assert not any(finding.found for finding in findings if finding.subject in ("axes", "lever"))


def edited(name: str, old: str, new: str) -> tuple[str, str, str]:
    return name, old, new


BAD_CSV = [
    (edited("twists.csv", "vx_mps", "v_x"), "lacks the column vx_mps; there are"),
    (edited("twists.csv", "t_ns", "time"), "lacks the column t_s"),
    (edited("twists.csv", "\n200000000,", "\n50000000,"), "row 4: time does not ascend"),
    (edited("twists.csv", "\n100000000,", "\nsoon,"), "row 3: t_ns is 'soon'"),
    (edited("twists.csv", "\n100000000,", "\n100000000,1,"), "row 3: has 8 cells"),
    (edited("stereo.csv", "uL_px", "u"), "lacks the column uL_px"),
    (edited("truth.csv", "\n0.000000000,", "\n-1.0,"), "seconds from 0"),
    (edited("truth.csv", "qw", "q0"), "lacks the column qw"),
    (edited("truth.csv", "qx,qy,qz,qw", "q1,qy,qz,qw"), "lacks the column qx"),
    (edited("truth.csv", "qx,qy,qz,qw", "px_m,qy,qz,qw"), "names the column px_m twice"),
    (edited("stereo.csv", ",0,", f",{'9' * 5000},"), "a whole number from 0 to 4294967295"),
    (edited("camera.json", '"fx_px"', '"fx"'), "unknown name fx"),
    (edited("camera.json", '"R_BC"', '"R_CB"'), "lacks t_CB_m"),
    (edited("camera.json", '"twist_timing": "end"', '"twist_timing": "late"'), "start or end"),
    (edited("camera.json", '"pixel_sigma_px": 0.5', '"pixel_sigma": 1'), "unknown name pixel_"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": -1'), "must be positive"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": 200'), "are these millimetres"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": "wide"'), "a finite number"),
    (edited("camera.json", '"image_width_px": 640', '"image_width_px": 1e9'), "0 to 65535"),
    (edited("camera.json", "{", "["), "is no JSON"),
    (edited("camera.json", "{", "[" * 100_000), "is nested too deep"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": 1' + "0" * 400), "401 digits"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": 1' + "0" * 5000), "5001 digits"),
    (edited("camera.json", '"baseline_m": 0.2', '"baseline_m": 1e999'), "which no double holds"),
    (edited("camera.json", '"pixel_sigma_px": 0.5', '"pixel_sigma_px": NaN'), "names with numbers"),
    (edited("camera.json", '"twist_timing": "end"', '"twist_timing": ["end"]'), "start or end"),
    (edited("camera.json", '"name": ', '"fx_px": 1, "name": '), "'fx_px' twice"),
    (edited("camera.json", '"name": "mine"', '"name": ["mine"]'), "words are expected"),
    (edited("camera.json", '"name": "mine"', r'"name": "\ud800"'), "half of a surrogate pair"),
]


@pytest.mark.parametrize(("edit", "said"), BAD_CSV, ids=[said[:30] for _, said in BAD_CSV])
def test_a_mistake_in_a_users_file_is_told_by_file_row_and_name(
    tmp_path: Path, pelorus: Run, edit: tuple[str, str, str], said: str
) -> None:
    options = csv_files(tmp_path, clean(**SHORT))
    name, old, new = edit
    text = (tmp_path / name).read_bytes().decode().replace("\r\n", "\n")
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert name in outcome.err
    assert said in outcome.err, outcome.err


def test_files_that_were_taken_for_each_other_are_told_by_their_columns(
    tmp_path: Path, pelorus: Run
) -> None:
    options = csv_files(tmp_path, clean(**SHORT))
    twists, stereo = options.index("--twists") + 1, options.index("--stereo") + 1
    options[twists], options[stereo] = options[stereo], options[twists]
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert "stereo.csv: lacks the column vx_mps" in outcome.err


def test_a_file_parted_by_semicolons_is_told_so(tmp_path: Path, pelorus: Run) -> None:
    said = refusal_of_twists(tmp_path, pelorus, (",", ";"))
    assert "commas should part them" in said


def test_what_too_few_data_cannot_tell_is_not_called_good(tmp_path: Path, pelorus: Run) -> None:
    options = csv_files(tmp_path, clean(**SHORT))
    said = pelorus("convert", "csv", *options, tmp_path / "out.plr")
    assert "stale tracks: good" in said.out
    assert "twist noise: cannot tell" in said.out


def test_csv_observations_must_be_one_an_id_and_frame(tmp_path: Path, pelorus: Run) -> None:
    options = csv_files(tmp_path, clean(**SHORT))
    path = tmp_path / "stereo.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows, rows[1]]) + "\n")
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert re.search(f"stands twice in the frame at .*rows 2 and {len(rows) + 1}", outcome.err)
    path.write_text(rows[0] + "\n")
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert "no row" in outcome.err
    path.write_text("")
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert "is empty" in outcome.err


def test_twists_and_frames_of_different_clocks_are_refused(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    options = csv_files(tmp_path, drive)
    rows = (tmp_path / "twists.csv").read_text().splitlines()
    late = [
        rows[0],
        *(f"{int(row.split(',')[0]) + 10**15},{row.split(',', 1)[1]}" for row in rows[1:]),
    ]
    (tmp_path / "twists.csv").write_text("\n".join(late) + "\n")
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert "do not overlap" in outcome.err


# --- calibrations of other programs ---------------------------------------------------------------


def test_raw_tracks_and_a_camchain_become_those_of_a_rectified_pair(
    tmp_path: Path, pelorus: Run
) -> None:
    drive, cameras = clean(**SHORT), Cameras()
    q_C = triangulate(drive.header.camera, drive.tracks.pixels)
    raw = replace(drive.tracks, pixels=cameras.see(q_C))
    seen = replace(drive, tracks=raw)
    options = csv_files(tmp_path, seen)
    shift_s = 0.013
    kalibr = write_yaml(
        tmp_path / "camchain.yaml", camchain(cameras, (2000, 2000), timeshift_cam_imu=shift_s)
    )
    options[options.index("--calibration") + 1] = kalibr
    target = tmp_path / "mine.plr"
    pelorus("convert", "csv", *options, "--fix", "none", target)
    header, stereos = messages_of(target, Header)[0], messages_of(target, Stereo)
    T_CL = Poses(header.R_CB @ cameras.T_LB.R.T, np.zeros(3))
    assert np.allclose(header.t_CB_m, T_CL.R @ cameras.T_LB.p)
    far = q_C[:, 2] > 0.5
    due = project(header.camera, se3.apply(T_CL, q_C[far]))
    ids = np.concatenate([m.ids for m in stereos])
    assert len(ids) == len(q_C)
    pixels = np.concatenate([m.pixels for m in stereos])[far]
    assert np.abs(pixels - due).max() < 0.01
    assert [m.t_ns for m in stereos] == (drive.frame_t_ns + 13_000_000).tolist()
