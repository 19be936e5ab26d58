# SPDX-License-Identifier: MIT
"""CSV files as users have them: other names and units, a wheel speed alone, an IMU, any truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import SHORT, Run, messages_of
from drives import PERFECT, clean
from pelorus.errors import PelorusError
from pelorus.io import arrays
from pelorus.io.recording import Recording
from pelorus.simulate.simulate import simulate
from pelorus.wire.frames import Header, Imu, Process, Reading, Stereo, Truth, Twist
from replay_drive import BIN, judged
from scipy.spatial.transform import Rotation
from test_convert_csv import csv_files, refusal_of_twists, write_csv

TODAY_NS = 1_763_822_000_123_456_789  # a double has no such nanoseconds


def options_of(folder: Path, drive: Recording, *without: str) -> list[Any]:
    """Returns the options of `convert csv`, without some of the files."""
    words = csv_files(folder, drive)
    pairs = zip(words[::2], words[1::2], strict=True)
    return [word for name, path in pairs if name not in without for word in (name, path)]


def test_columns_with_other_names_and_units_mean_what_the_mapping_says(
    tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--twists", "--truth", "--stereo")
    v, w, tracks = drive.v_B_mps.T, drive.w_B_radps.T, drive.tracks
    stamps = [f"{(TODAY_NS + t) // 10**6}.{(TODAY_NS + t) % 10**6:06d}" for t in drive.twist_t_ns]
    twists = {
        "stamp_ms": stamps,
        "speed_kmh": (v[0] * 3.6).tolist(),
        "left": (v[1] * 1e3).tolist(),
        "up_mps": v[2].tolist(),
        "roll_rate_degps": np.degrees(w[0]).tolist(),
        "pitch_rate_dps": np.degrees(w[1]).tolist(),
        "yaw rate": np.degrees(w[2]).tolist(),
    }
    stereo = {
        "when": [str((TODAY_NS + t) // 1000) for t in drive.frame_t_ns[tracks.frame]],
        "track": tracks.id.tolist(),
        **dict(zip(("x1", "y1", "x2", "y2"), tracks.pixels.T.tolist(), strict=True)),
    }
    names = (
        "t=stamp_ms,v=speed_kmh,vy=left:mmps,vz=up_mps,wx=roll_rate_degps,wy=pitch_rate_dps",
        "w=yaw rate:deg/s,stereo.t=when:us,id=track,uL=x1,vL=y1,uR=x2,vR=y2",
    )
    target = tmp_path / "mine.plr"
    pelorus(
        *("convert", "csv", *options, target, "--fix", "none"),
        *("--twists", write_csv(tmp_path / "odometry.csv", twists)),
        *("--stereo", write_csv(tmp_path / "points.csv", stereo)),
        *(word for mapping in names for word in ("--columns", mapping)),
    )
    found = messages_of(target, Twist)
    assert [m.t_ns for m in found] == [TODAY_NS + t for t in drive.twist_t_ns]
    assert np.allclose([m.v_B_mps for m in found], drive.v_B_mps, rtol=1e-12)
    assert np.allclose([m.w_B_radps for m in found], drive.w_B_radps, rtol=1e-12)
    frames = messages_of(target, Stereo)
    assert [m.t_ns for m in frames] == [(TODAY_NS + t) // 1000 * 1000 for t in drive.frame_t_ns]
    pixels = np.concatenate([m.pixels for m in frames])
    assert np.array_equal(pixels, tracks.pixels.astype(np.float32))


def test_an_imu_in_place_of_twists_with_a_wheel_beside_it(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--twists")
    times = drive.twist_t_ns.tolist()
    names = ("ax_mps2", "ay_mps2", "wx_radps", "wy_radps", "wz_radps")
    imu = {name: [k + 0.01 * j for j in range(len(times))] for k, name in enumerate(names)}
    imu |= {"t_ns": times, "up_g": [1.0] * len(times)}
    wheel = {"t_ns": times, "speed": [36.0] * len(times), "sigma_mps": [0.1] * len(times)}
    target = tmp_path / "mine.plr"
    pelorus(
        *("convert", "csv", *options, target),
        *("--imu", write_csv(tmp_path / "imu.csv", imu)),
        *("--wheel", write_csv(tmp_path / "wheel.csv", wheel)),
        *("--columns", "az=up_g,wheel.v=speed:km/h"),
    )
    assert messages_of(target, Header)[0].process is Process.IMU
    assert messages_of(target, Twist) == []
    found = messages_of(target, Imu)
    a = np.concatenate([m.a_B_mps2 for m in found])
    assert np.allclose(a, np.stack((imu["ax_mps2"], imu["ay_mps2"], [9.80665] * len(times)), -1))
    w = np.concatenate([m.w_B_radps for m in found])
    assert np.allclose(w[:, 2], imu["wz_radps"])
    readings = messages_of(target, Reading)
    assert readings[0].value[0] == pytest.approx(10.0)


@pytest.mark.parametrize("timing", ["start", "end", "mid"])
def test_a_wheel_and_a_gyro_in_files_of_their_own_make_twists_that_turn_as_the_gyro(
    timing: str, tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--twists")
    times = drive.twist_t_ns.tolist()
    fast = np.arange(times[0], times[-1] + 1, 5_000_000)
    rate = np.sin(fast * 3e-9)  # turns by the integral of it
    gyro = {"t_ns": fast.tolist(), "gz_degps": np.degrees(rate).tolist()}
    gyro |= {"wx_radps": [0.1] * len(fast), "wy_radps": [-0.2] * len(fast)}
    speed = {"t_ns": times, "vx_mps": [2.0] * len(times)}
    target = tmp_path / "mine.plr"
    pelorus(
        *("convert", "csv", *options, target, "--measured", "vx", "--columns", "wz=gz_degps"),
        *("--twists", write_csv(tmp_path / "wheel.csv", speed), "--twist-timing", timing),
        *("--gyro", write_csv(tmp_path / "gyro.csv", gyro)),
    )
    twists, noise = messages_of(target, Twist), messages_of(target, Header)[0].noise
    assert noise.gyro_sigma_x_radps < 0 < noise.velocity_sigma_y_mps
    w = np.array([m.w_B_radps for m in twists])
    assert np.allclose(w[:, :2], [0.1, -0.2])
    t = np.array(times)
    turned = np.diff(-np.cos(t * 3e-9) / 3)
    held = {"start": w[:-1, 2], "end": w[1:, 2], "mid": 0.5 * (w[1:, 2] + w[:-1, 2])}[timing]
    off = np.abs(held * np.diff(t) * 1e-9 - turned)[1:-1]  # nothing is known beyond the ends
    assert off.max() < (1.3e-3 if timing == "mid" else 1e-4)


def test_an_imu_in_g_or_without_gravity_is_refused(tmp_path: Path, pelorus: Run) -> None:
    options = options_of(tmp_path, clean(**SHORT), "--twists")
    for up, said in (
        (1.0, "is 1 m/s^2 in the median; about 9.81 is expected: is it in g"),
        (0.0, "is 0"),
    ):
        names = ("ax_mps2", "ay_mps2", "wx_radps", "wy_radps", "wz_radps")
        imu = {"t_s": [0.0, 3.0, 6.0], "az_mps2": [up] * 3, **{name: [0.0] * 3 for name in names}}
        path = write_csv(tmp_path / "imu.csv", imu)
        outcome = pelorus("convert", "csv", *options, "--imu", path, tmp_path / "out.plr", status=1)
        assert f"imu.csv: the specific force {said}" in outcome.err


@pytest.mark.parametrize("form", ["tum", "euroc", "euroc-poses"])
def test_the_truth_may_be_a_file_of_tum_or_euroc(tmp_path: Path, pelorus: Run, form: str) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--truth")
    path, rows = tmp_path / "truth", []
    for t, R, p in zip(drive.truth_t_ns.tolist(), *drive.truth, strict=True):
        x, y, z, w = Rotation.from_matrix(R).as_quat()
        if form == "tum":
            rows.append(f"{t / 1e9:.9f} {p[0]} {p[1]} {p[2]} {x} {y} {z} {w}")
        else:
            more = ",0" * 9 if form == "euroc" else ""
            rows.append(f"{t + 10**18},{p[0]},{p[1]},{p[2]},{w},{x},{y},{z}{more}")
    path.write_text("# a comment\n" + "\n".join(rows) + "\n")
    if form != "tum":  # its times are today's
        for name in ("twists.csv", "stereo.csv"):
            _on_todays_clock(tmp_path / name)
    target = tmp_path / "mine.plr"
    pelorus("convert", "csv", *options, "--truth", path, target)
    found = messages_of(target, Truth)
    assert len(found) == len(drive.truth_t_ns)
    assert np.allclose([m.R_WB for m in found], drive.truth.R)
    assert np.allclose([m.p_WB_m for m in found], drive.truth.p)


def _on_todays_clock(path: Path) -> None:
    names, *rows = path.read_text().splitlines()
    at = names.split(",").index("t_ns")
    cells = [row.split(",") for row in rows]
    shifted = [[*row[:at], str(int(row[at]) + 10**18), *row[at + 1 :]] for row in cells]
    path.write_text("\n".join([names, *(",".join(row) for row in shifted), ""]))


def test_frames_between_two_true_poses_get_one_between_them(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive)
    path = tmp_path / "truth.csv"
    names, *rows = path.read_text().splitlines()
    path.write_text("\n".join([names, *rows[::2], ""]))
    target = tmp_path / "mine.plr"
    pelorus("convert", "csv", *options, target)
    found = messages_of(target, Truth)
    assert [m.t_ns for m in found] == drive.truth_t_ns.tolist()
    assert np.abs(np.array([m.p_WB_m for m in found]) - drive.truth.p).max() < 0.02
    path.write_text("\n".join([names, *rows[::8], ""]))  # 0.8 s: too far apart to make one up
    pelorus("convert", "csv", *options, target, "--force")
    assert len(messages_of(target, Truth)) == len(rows[::8])


@pytest.mark.parametrize("lap_s", [40.0, 6.0])  # a robot turns as fast as it likes
def test_a_wheel_speed_alone_and_pictures_find_the_way(
    lap_s: float, tmp_path: Path, pelorus: Run
) -> None:
    if not (BIN / "pelorus-replay").exists():
        pytest.skip(f"{BIN / 'pelorus-replay'} is not built")
    drive = simulate(replace(PERFECT, lap_s=lap_s)).recording
    options = options_of(tmp_path, drive, "--twists")
    speed = {"t_ns": drive.twist_t_ns.tolist(), "speed_mps": drive.v_B_mps[:, 0].tolist()}
    target = tmp_path / "mine.plr"
    pelorus(
        *("convert", "csv", *options, target, "--columns", "v=speed_mps", "--measured", "vx"),
        *("--twists", write_csv(tmp_path / "speed.csv", speed)),
    )
    noise = messages_of(target, Header)[0].noise
    assert noise.velocity_sigma_x_mps < 0 < noise.velocity_sigma_y_mps
    in_frame = np.diff(drive.frame_t_ns[:2]) / np.diff(drive.twist_t_ns[:2])
    assert noise.gyro_sigma_x_radps == pytest.approx(3.0 * np.sqrt(in_frame[0]))
    alone = judged(target, "--mode", "dead_reckoning")["err0_m"]
    together = judged(target, "--pixel-sigma", "0.5")
    assert alone > 5
    assert together["err0_m"] < 0.05 * alone
    assert together["frames_good"] >= together["frames"] - 1  # the first one makes the landmarks


@pytest.mark.parametrize(("size", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_times_of_another_unit_are_named(size: float, unit: str) -> None:
    with pytest.raises(PelorusError, match=f"are they {unit}.*--columns t=t_s:{unit}"):
        arrays.check_seconds(Path("twists.csv"), "t_s", np.array([1.7e9, 1.7e9 + 60]) * size)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--columns", "v=vx_mps,q=x"),
            "--columns q=x: NAME=COLUMN is expected, such as v=speed_mps",
        ),
        (("--columns", "v"), "--columns v: NAME=COLUMN is expected"),
        (
            ("--columns", "v=pace"),
            "in which unit is pace? v=pace:UNIT is expected, with mps or m/s or",
        ),
        (
            ("--columns", "t=stamp:min"),
            "min is no unit of t: t=stamp:UNIT is expected, with ns or us or",
        ),
        (("--columns", "v=pace_mps"), "no file has the column pace_mps; there are: "),
        (("--columns", "vy=vx_mps"), "has the column vy_mps, and vx_mps is to be called so"),
        (
            ("--measured", "vx,yaw"),
            "--measured vx,yaw: some of vx, vy, vz, wx, wy, wz are expected",
        ),
        (("--imu", "imu.csv"), "--twists and --imu given; one is expected"),
    ],
)
def test_options_that_make_no_sense_are_refused_with_what_would_be_right(
    tmp_path: Path, pelorus: Run, words: tuple[str, str], said: str
) -> None:
    outcome = pelorus(
        "convert",
        "csv",
        *csv_files(tmp_path, clean(**SHORT)),
        *words,
        tmp_path / "out.plr",
        status=1,
    )
    assert said in outcome.err
    assert not list(tmp_path.glob("out*"))


def test_velocities_that_are_not_there_are_named_with_what_to_do(
    tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--twists")
    few = {"t_ns": drive.twist_t_ns.tolist(), "vx_mps": [1] * 61, "wz_radps": [0] * 61}
    outcome = pelorus(
        *("convert", "csv", *options, tmp_path / "out.plr"),
        *("--twists", write_csv(tmp_path / "few.csv", few)),
        status=1,
    )
    assert "lacks the column vy_mps, vz_mps, wx_radps, wy_radps; there are: " in outcome.err
    assert "--measured vx,wz. If they are called otherwise: --columns vy=COLUMN:mps" in outcome.err


def test_columns_of_other_names_are_told_how_to_be_named_whichever_file_lacks_them(
    tmp_path: Path, pelorus: Run
) -> None:
    files = csv_files(tmp_path, clean(**SHORT))
    for name, old, new, hint in (
        ("twists.csv", "ps", "", "--columns vx=COLUMN:mps"),
        ("truth.csv", "p", "at_", "--columns px=COLUMN:m"),
        ("stereo.csv", "_px", "_pixel", "--columns uL=COLUMN"),
        ("stereo.csv", "t_ns", "stamp", "--columns t=COLUMN:s"),
    ):
        text = (tmp_path / name).read_text()
        first, rest = text.split("\n", 1)
        (tmp_path / name).write_text(first.replace(old, new) + "\n" + rest)
        outcome = pelorus("convert", "csv", *files, tmp_path / "out.plr", status=1)
        assert f"called otherwise: {hint}" in outcome.err
        (tmp_path / name).write_text(text)


def test_a_column_in_another_unit_is_named_as_it_is(tmp_path: Path, pelorus: Run) -> None:
    """Whoever copied `wx=COLUMN:radps` would have degrees taken for radians."""
    said = refusal_of_twists(tmp_path, pelorus, ("radps", "degps"))
    assert "called otherwise: --columns wx=wx_degps" in said


def test_semicolons_with_decimal_commas_and_zero_bytes_are_told(
    tmp_path: Path, pelorus: Run
) -> None:
    files = csv_files(tmp_path, clean(**SHORT))
    path = tmp_path / "twists.csv"
    whole = path.read_text()
    path.write_text(whole.replace(",", ";").replace(".", ","))
    outcome = pelorus("convert", "csv", *files, tmp_path / "out.plr", status=1)
    assert "points in numbers, and commas between them, are expected" in outcome.err
    path.write_bytes(whole.encode("utf-16-le"))
    outcome = pelorus("convert", "csv", *files, tmp_path / "out.plr", status=1)
    assert "byte 1: is no text; text in UTF-8 is expected" in outcome.err


def test_files_with_plain_names_and_a_few_bad_rows_are_converted_and_that_is_said(
    tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    files, target = csv_files(tmp_path, drive), tmp_path / "out.plr"
    for name in ("twists", "truth", "stereo"):
        path = tmp_path / f"{name}.csv"
        names, *rows = path.read_text().splitlines()
        for unit in ("_mps", "_radps", "_px", "_m"):
            names = names.replace(unit, "")
        if name != "stereo":
            rows[4] = rows[4].rpartition(",")[0] + ",nan"
        path.write_text("\n".join([names, *rows, ""]))
    said = pelorus("convert", "csv", *files, target, "--fix", "none").out
    for words in ("vx, vy, vz in mps; wx, wy, wz in radps.", "taken px, py, pz in m. In another"):
        assert words in said
    for words in ("twists.csv: 1 of 61 rows are left out, row 6", "truth.csv: 1 of 61 rows"):
        assert words in said
        assert words in pelorus("info", target).out
    found = messages_of(target, Twist)
    assert np.allclose([m.v_B_mps for m in found], np.delete(drive.v_B_mps, 4, axis=0))
    assert len(messages_of(target, Truth)) == 61  # between its neighbours there is one


def test_the_name_that_the_project_asks_for_names_its_unit(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    files = csv_files(tmp_path, drive)
    twists = tmp_path / "twists.csv"
    twists.write_text(twists.read_text().replace("vx_mps", "vx").replace("wz_radps", "rate_dps"))
    named = ("--columns", "vx_mps=vx,wz_radps=rate_dps")
    target = tmp_path / "out.plr"
    pelorus("convert", "csv", *files, target, *named, "--fix", "none")
    found = messages_of(target, Twist)
    assert np.allclose([m.v_B_mps[0] for m in found], drive.v_B_mps[:, 0])
    assert np.allclose([m.w_B_radps[2] for m in found], np.radians(drive.w_B_radps[:, 2]))
    for wrong in ("vx_kg=vx", "mps=vx"):
        again = (*files, tmp_path / "no.plr", "--columns", wrong)
        said = pelorus("convert", "csv", *again, status=1).err
        assert f"--columns {wrong}: NAME=COLUMN is expected" in said


def test_a_complaint_calls_a_column_as_its_file_does(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    options = options_of(tmp_path, drive, "--twists")
    rows = len(drive.twist_t_ns)
    odometry = {
        "stamp_ms": (drive.twist_t_ns // 10**6).tolist(),
        "speed_kmh": [3] * rows,
    }

    def complaint(mapping: str, rate: str) -> str:
        turning = odometry | {"roll_rate_dps": [rate, *([0] * (rows - 1))]}
        path = write_csv(tmp_path / "odometry.csv", turning)
        given = ("--measured", "vx,wx", "--columns", mapping, "--twists", path)
        outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", *given, status=1)
        said: str = outcome.err
        return said

    named = "v=speed_kmh,wx=roll_rate_dps"
    said = complaint(f"{named},twists.t=stamp_ms", "fast")
    assert "row 2: roll_rate_dps is 'fast', a number is expected" in said
    typed = complaint(f"{named},twists.t=stmp_ms", "0")
    assert "lacks the column stmp_ms; there are: stamp_ms, speed_kmh, roll_rate_dps" in typed


def test_the_first_screen_of_convert_tells_whose_data_are_for_which_command(pelorus: Run) -> None:
    said = pelorus("convert", "--help").out
    own, known = said.index("Your own data"), said.index("Files of known data sets")
    assert own < said.index("euroc") < known < said.index("starry-night")
    assert own < said.index(" csv ") < known
