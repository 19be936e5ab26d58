# SPDX-License-Identifier: MIT
"""Small sensors end to end: simulated or read from CSV, counted, replayed, judged."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from converted import SHORT, Run, messages_of
from drives import PERFECT, clean
from pelorus.io.recording import Recording
from pelorus.io.small_sensors import SMALL_SENSORS, SmallSensor
from pelorus.simulate.imu import SimulatedImu
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.readings import Sensing
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire import framing as wire
from pelorus.wire.frames import Reading
from pelorus.wire.layout import Floats
from replay_drive import ROOT, judged, run
from test_convert_blind import imu as imu_csv
from test_convert_csv import csv_files, write_csv

ARM = (0.4, -0.3, 0.2)
WHEEL, STANDSTILL, POSITION = (sensor.number for sensor in SMALL_SENSORS[:3])


def readings(recording: Recording, sensor: int) -> list[Reading]:
    return [reading for reading in recording.readings if reading.sensor == sensor]


def values(recording: Recording, sensor: int) -> Floats:
    return np.array([reading.value for reading in readings(recording, sensor)])


# --- simulated ------------------------------------------------------------------------------------


def test_without_noise_a_position_is_that_of_its_point_of_the_body() -> None:
    sensing = {"position": Sensing(rate_hz=10.0, at_m=ARM)}
    drive = simulate(replace(PERFECT, readings=sensing)).recording
    noise = values(drive, POSITION) - (drive.truth.p + drive.truth.R @ ARM)[1:]
    assert noise.std() == pytest.approx(0.05, rel=0.1)
    assert abs(noise.mean()) < 0.01
    assert all(reading.axes == 7 for reading in drive.readings)
    assert np.allclose(drive.readings[0].at_B_m, ARM)


def test_a_wheel_reads_the_velocity_of_its_point_from_now_on() -> None:
    sensing = {"wheel": Sensing(rate_hz=100.0, axes="xyz", at_m=ARM, sigma=(1e-9,))}
    drive = simulate(replace(PERFECT, readings=sensing, duration_s=5.0)).recording
    v, w = drive.v_B_mps[1:], drive.w_B_radps[1:]
    assert np.allclose(values(drive, WHEEL)[:-1], (v + np.cross(w, ARM))[:-1], atol=1e-7)


def test_what_is_not_measured_is_zero_and_chance_of_others_stays() -> None:
    sensing = {
        "wheel": Sensing(rate_hz=50.0, axes="y", sigma=(0.1, 0.2, 0.3)),
        "position": Sensing(rate_hz=5.0, axes="z"),
    }
    both = simulate(replace(PERFECT, readings=sensing, velocity_sigma_mps=0.1)).recording
    alone = simulate(replace(PERFECT, velocity_sigma_mps=0.1)).recording
    assert np.array_equal(both.v_B_mps, alone.v_B_mps)
    first = readings(both, WHEEL)[0]
    assert first.axes == 2
    assert first.sigma.tolist() == [0, 0.2, 0]
    assert first.value[0] == first.value[2] == 0
    height = readings(both, POSITION)[0]
    assert (height.axes, height.sigma.tolist()) == (4, [0, 0, 0.05])


def test_a_position_sees_a_jump() -> None:
    sensing = {"position": Sensing(rate_hz=10.0, at_m=ARM, sigma=(1e-9,))}
    mishaps = Mishaps(jump_m=2.0, jump_at_s=5.0)
    drive = simulate(replace(PERFECT, readings=sensing, mishaps=mishaps)).recording
    where = drive.truth.p + drive.truth.R @ ARM
    assert np.allclose(values(drive, POSITION), where[1:], atol=1e-7)
    assert np.linalg.norm(np.diff(drive.truth.p, axis=0), axis=1)[49] > 1.9


def test_readings_are_lost_and_wrong_in_the_share_asked_for() -> None:
    sensing = {"position": Sensing(rate_hz=10.0, drop=0.2, outliers=0.1)}
    drive = simulate(replace(PERFECT, duration_s=200.0, readings=sensing)).recording
    assert len(drive.readings) == pytest.approx(1600, abs=60)
    at = np.searchsorted(drive.truth_t_ns, [reading.t_ns for reading in drive.readings])
    off = np.abs(values(drive, POSITION) - drive.truth.p[at]).max(axis=1)
    assert (off > 0.3).mean() == pytest.approx(0.1, abs=0.02)
    assert off.max() < 5.3


def test_a_standstill_is_told_while_the_body_rests_and_ends_before_it_drives_off() -> None:
    options = replace(PERFECT, stop=Span(5.0, 4.0), readings={"standstill": Sensing(rate_hz=10.0)})
    drive = simulate(options).recording
    told = [reading.t_ns * 1e-9 for reading in drive.readings]
    assert told[0] == 5.0
    assert told[-1] == pytest.approx(8.8, abs=0.01), "it holds for two intervals"
    assert not values(drive, STANDSTILL).any()
    assert drive.readings[0].sigma.tolist() == [0.002, 0.0005, 0]
    moved = np.linalg.norm(np.diff(drive.truth.p, axis=0), axis=1)
    assert (moved[50:90] == 0).all()
    assert (np.delete(moved, np.arange(50, 90)) > 0.1).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--wheel-sigma", 0.1), "--wheel-sigma is 0.1: --wheel-rate beside it"),
        (("--wheel-rate", 30), "--wheel-rate is 30.0: a whole part of the twist rate, 100"),
        (("--wheel-rate", -1), "--wheel-rate is -1.0: a finite number, not negative"),
        (("--wheel-rate", 50, "--wheel-sigma", "0.1,0"), "--wheel-sigma is 0.1,0: one positive"),
        (("--wheel-rate", 50, "--wheel-sigma", "0.1,x"), "--wheel-sigma is '0.1,x': a number"),
        (("--wheel-rate", 50, "--wheel-axes", "xw"), "--wheel-axes is xw: some of the letters xyz"),
        (("--wheel-rate", 50, "--wheel-at", "1,2"), "--wheel-at is 1,2: three numbers of metres"),
        (("--position-rate", 5, "--position-drop", 1), "--position-drop is 1.0: a fraction"),
    ],
)
def test_options_of_a_sensor_that_make_no_sense_are_refused_by_name(
    tmp_path: Path, pelorus: Run, options: tuple[object, ...], said: str
) -> None:
    outcome = pelorus("simulate", tmp_path / "x.plr", *options, status=1)
    assert said in outcome.err
    assert not (tmp_path / "x.plr").exists()


def test_info_shows_readings_by_sensor(tmp_path: Path, pelorus: Run) -> None:
    target = tmp_path / "x.plr"
    options = ("--duration", 10, "--wheel-rate", 50, "--wheel-axes", "xy", "--wheel-sigma", 0.03)
    stops = ("--stop-from", 2, "--stop-for", 3, "--standstill-rate", 10)
    pelorus("simulate", target, *options, *stops)
    found = messages_of(target, Reading)
    assert [m.t_ns for m in found] == sorted(m.t_ns for m in found)
    said = " ".join(pelorus("info", target).out.split())
    for words in (
        "READING 529",
        "READING wheel 0.020 10.000 50.00 0",
        "READING standstill 2.000 4.800 10.00 0",
        "500 readings of a wheel, axes xy, sigma 0.03 (median), values",
        "the wheels sit at (0, 0, 0) m (x, y, z of the body); they read exactly 0 for 0.0 of",
        "29 readings of a standstill, axes vw, sigma 0.002, 0.0005 (median)",
        "no damage",
    ):
        assert words in said, words


@pytest.mark.parametrize(("track_m", "stand_s"), [(0.5, 4.0), (0.0, 7.5)])
def test_info_tells_where_wheels_sit_what_they_read_and_for_how_long_they_stand(
    track_m: float, stand_s: float, tmp_path: Path, pelorus: Run
) -> None:
    target, stands = tmp_path / "x.plr", tmp_path / "still.plr"
    rates = ("--imu-rate", 200, "--wheel-rate", 50, "--wheel-track", track_m)
    pelorus("simulate", target, "--duration", 15, *rates)
    messages = list(wire.messages_of(target))
    end_ns = next(m.t_ns for m in messages if isinstance(m, Reading)) + stand_s * 1e9
    for k, m in enumerate(messages):
        if isinstance(m, Reading) and m.t_ns < end_ns:
            messages[k] = replace(m, value=np.zeros(3))
    wire.write_file(stands, messages, len(messages))
    (wheel,) = json.loads(pelorus("info", stands, "--json").out)["sensors"].values()
    assert wheel["zero_s"] == pytest.approx(stand_s, abs=0.1)
    sides = [place[1] for place in wheel["places_B_m"]]
    assert sides == pytest.approx([-track_m / 2, track_m / 2] if track_m else [0.0])
    ((least, most),) = wheel["ranges"]
    assert least == 0
    assert most == max(m.value[0] for m in messages if isinstance(m, Reading))


def test_no_option_of_simulate_has_the_name_of_another(pelorus: Run) -> None:
    said = pelorus("simulate", "--help").out
    names = re.findall(r"^│ (--[a-z-]+)\s", said, re.MULTILINE)
    assert len(names) > 50
    assert sorted(names) == sorted(set(names))


def test_info_tells_of_pauses_and_of_sensors_that_it_does_not_know(
    tmp_path: Path, pelorus: Run
) -> None:
    times = (0, 100, 200, 500, 600)
    strange = [Reading(t * 1_000_000, 77, 1, sigma=np.full(3, 0.5)) for t in times]
    replace(clean(**SHORT), readings=strange).write(tmp_path / "x.plr")
    said = pelorus("info", tmp_path / "x.plr").out
    assert "gap: READING sensor 77 pauses for 0.300 s after 0.200 s" in said
    assert "5 readings of a sensor 77, axes 0, sigma 0.5" in said


def test_the_page_on_adding_a_sensor_shows_the_code_that_there_is() -> None:
    page = (ROOT / "docs" / "ADD-A-SENSOR.md").read_text()
    shown, path = 0, None
    for part in re.split(r"(```\w*\n.*?```)", page, flags=re.DOTALL):
        if not part.startswith("```"):
            named = re.findall(r"^`([\w./]+\.\w+)`", part, flags=re.MULTILINE)
            path = ROOT / named[-1] if named else path
            continue
        assert path is not None
        code = part.split("\n", 1)[1].removesuffix("```")
        assert code in path.read_text(), f"{path.name} has it otherwise:\n{code}"
        shown += 1
    assert shown == 5


# --- from CSV -------------------------------------------------------------------------------------


def sensor_files(folder: Path) -> list[Any]:
    t_s = [0.0, 0.1, 0.2]
    wheel = {"t_s": t_s, "vx_mps": [1, 2, 3], "sigma_mps": [0.1] * 3}
    arm = {"at_x_m": [0.5] * 3, "at_y_m": [0] * 3, "at_z_m": [-1] * 3}
    standstill = {"t_s": t_s, "sigma_radps": [0.01] * 3}
    position = {"px_m": [4, 5, 6], "pz_m": [7, 8, 9], "t_ns": [0, 10**8, 2 * 10**8]}
    sigmas = {"sigma_px_m": [0.2] * 3, "sigma_m": [0.3] * 3}
    return [
        *("--wheel", write_csv(folder / "wheel.csv", wheel | arm)),
        *("--standstill", write_csv(folder / "standstill.csv", standstill)),
        *("--position", write_csv(folder / "position.csv", position | sigmas)),
    ]


def test_readings_from_csv_arrive_whole(tmp_path: Path, pelorus: Run) -> None:
    options = [*csv_files(tmp_path, clean(**SHORT)), *sensor_files(tmp_path)]
    target = tmp_path / "mine.plr"
    outcome = pelorus("convert", "csv", *options, target)
    assert "9 readings" in " ".join(outcome.out.split())
    found = messages_of(target, Reading)
    assert [m.sensor for m in found] == [WHEEL, STANDSTILL, POSITION] * 3
    wheel, standstill, position = found[3:6]
    assert (wheel.t_ns, wheel.axes) == (10**8, 1)
    assert wheel.value.tolist() == [2, 0, 0]
    assert wheel.sigma == pytest.approx([0.1, 0, 0])
    assert wheel.at_B_m.tolist() == [0.5, 0, -1]
    assert standstill.axes == 2
    assert standstill.sigma == pytest.approx([0, 0.01, 0])
    assert not standstill.value.any()
    assert position.axes == 5
    assert position.value.tolist() == [5, 0, 8]
    assert position.sigma == pytest.approx([0.2, 0, 0.3])


def test_two_sensors_of_a_kind_are_two_files(tmp_path: Path, pelorus: Run) -> None:
    files = csv_files(tmp_path, clean(**SHORT))
    first = {"t_ns": [1000, 2000], "px_m": [1, 2], "sigma_m": [1, 1]}
    second = {"t_ns": [1000, 1500], "pz_m": [3, 4], "sigma_m": [1, 1]}
    paths = write_csv(tmp_path / "a.csv", first), write_csv(tmp_path / "b.csv", second)
    options = ("--position", paths[0], "--position", paths[1])
    pelorus("convert", "csv", *files, *options, tmp_path / "x.plr")
    found = [(m.t_ns, m.axes) for m in messages_of(tmp_path / "x.plr", Reading)]
    assert found == [(1000, 1), (1000, 4), (1500, 4), (2000, 1)]
    assert "does not ascend" not in pelorus("info", tmp_path / "x.plr").out


BAD = [
    ("wheel.csv", "vx_mps", "v", "measures nothing; some of vx_mps, vy_mps, vz_mps are expected"),
    ("wheel.csv", "sigma_mps", "s", "lacks the column sigma_mps"),
    ("wheel.csv", "0.1,2,0.1", "0.1,2,0", "row 3: sigma_mps is 0, a positive number"),
    ("wheel.csv", "0.1,2,0.1", "0.1,fast,0.1", "row 3: vx_mps is 'fast', a number is expected"),
    ("wheel.csv", "0.1,2,0.1", "0.1,nan,0.1", "vx_mps is not finite"),
    ("wheel.csv", "0.1,2,0.1", "0.1,1e12,0.1", "row 3: vx_mps is 1e+12, at most 1e+09"),
    ("wheel.csv", "at_y_m", "at_m", "lacks the column at_y_m"),
    ("wheel.csv", "0.1,2,0.1", "0.0,2,0.1", "row 3: time does not ascend"),
    ("standstill.csv", "sigma_radps", "sigma", "measures nothing; some of sigma_mps, sigma_radps"),
    ("position.csv", "px_m,pz_m", "x,z", "measures nothing; some of px_m"),
    ("position.csv", ",0,", ",0.5,", "row 2: t_ns is '0.5'"),
]


@pytest.mark.parametrize(("name", "old", "new", "said"), BAD)
def test_a_mistake_in_a_sensors_file_is_told_by_file_row_and_name(
    tmp_path: Path, pelorus: Run, name: str, old: str, new: str, said: str
) -> None:
    options = [*csv_files(tmp_path, clean(**SHORT)), *sensor_files(tmp_path)]
    text = (tmp_path / name).read_bytes().decode()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1))
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert name in outcome.err
    assert said in outcome.err, outcome.err
    assert not (tmp_path / "out.plr").exists()


def test_readings_of_another_clock_are_refused_and_early_ones_left_out(
    tmp_path: Path, pelorus: Run
) -> None:
    options = [*csv_files(tmp_path, clean(**SHORT)), *sensor_files(tmp_path)]
    wheel = options[options.index("--wheel") + 1]
    wheel.write_text("t_s,vx_mps,sigma_mps\n100,1,1\n101,1,1\n")
    outcome = pelorus("convert", "csv", *options, tmp_path / "out.plr", status=1)
    assert "wheel.csv" in outcome.err
    assert "do not overlap" in outcome.err


# --- replayed -------------------------------------------------------------------------------------

SEEDS = range(1, 6)
MODES = ("slam", "dead_reckoning")
DRIVE = Options(  # it stops for a while, so that a standstill has something to tell
    duration_s=20.0,
    landmarks=250,
    observations=20,
    velocity_sigma_mps=0.2,
    gyro_sigma_radps=0.02,
    stop=Span(4.0, 6.0),
)
NEES = (0.6, 1.6)  # a degree of freedom; of 5 drives whose errors last for seconds


class Outcome(NamedTuple):
    metres: float  # root mean square over the drives
    nees: float
    used: int
    gated: int


Drives = Callable[[Mapping[str, Sensing]], dict[str, Outcome]]


@pytest.fixture
def drives(tmp_path: Path, kept: Callable[[str, Callable[[], Any]], Any]) -> Drives:
    """The same drives with these sensors, replayed in both modes with the noise of the header."""

    def outcomes(sensing: Mapping[str, Sensing]) -> dict[str, Outcome]:
        found: dict[str, list[dict[str, Any]]] = {mode: [] for mode in MODES}
        for seed in SEEDS:
            path = tmp_path / f"{seed}.plr"
            simulate(replace(DRIVE, seed=seed, readings=sensing)).recording.write(path)
            for mode, row in found.items():
                row.append(judged(path, "--mode", mode))
        return {mode: outcome(row) for mode, row in found.items()}

    def outcome(row: list[dict[str, Any]]) -> Outcome:
        assert all(one.get("readings_refused", 0) == 0 for one in row)
        return Outcome(
            float(np.sqrt(np.mean([one["err0_m"] ** 2 for one in row]))),
            float(np.mean([one["nees_per_dof"] for one in row])),
            sum(one.get("readings_used", 0) for one in row),
            sum(one.get("readings_gated", 0) for one in row),
        )

    def get(sensing: Mapping[str, Sensing]) -> dict[str, Outcome]:
        if sensing:
            return outcomes(sensing)
        found: dict[str, Outcome] = kept("drives-without-small-sensors", lambda: outcomes({}))
        return found

    return get


# The error with a sensor over that without: at most so much in each mode. Beside a camera a sensor
# that has no row here need not help, but must not harm.
AT_MOST = {"wheel": (0.9, 0.95), "standstill": (0.98, 0.3), "position": (0.6, 0.1)}
ANOTHER = (1.1, 0.95)


@pytest.mark.parametrize("sensor", SMALL_SENSORS, ids=[s.name for s in SMALL_SENSORS])
def test_a_sensor_makes_the_pose_better_and_its_covariance_stays_true(
    sensor: SmallSensor, drives: Drives
) -> None:
    without = drives({})
    sensing = Sensing(rate_hz=10.0, axes=sensor.letters, at_m=ARM if sensor.has_arm else ())
    got = drives({sensor.name: sensing})
    for mode, most in zip(MODES, AT_MOST.get(sensor.name, ANOTHER), strict=True):
        assert got[mode].metres < most * without[mode].metres, mode
        assert NEES[0] < got[mode].nees < NEES[1], mode
        assert got[mode].used > 20 * got[mode].gated
        assert without[mode].used == 0


def used_of_all(path: Path, waits: int = 2) -> int:
    """How many readings are used of a drive of which nothing is late, nor refused for it."""
    told = judged(path)
    assert told["messages_refused"] == told["readings_refused"] == 0
    assert told["frames_good"] >= told["frames"] - waits, "frames until the IMU has started"
    return int(told["readings_used"])


@pytest.mark.parametrize(
    "sensing",
    [
        {"wheel": Sensing(rate_hz=50.0, sigma=(0.05,))},
        {"position": Sensing(rate_hz=5.0)},
        {"wheel": Sensing(rate_hz=100.0), "position": Sensing(rate_hz=20.0)},
    ],
    ids=["wheel", "position", "both"],
)
def test_no_batch_of_an_imu_reaches_beyond_a_reading_beside_it(
    tmp_path: Path, sensing: dict[str, Sensing]
) -> None:
    path = tmp_path / "imu.plr"
    options = Options(duration_s=20.0, imu=SimulatedImu(imu_rate_hz=200.0), readings=sensing)
    simulate(options).recording.write(path)
    assert used_of_all(path) > 0


def test_an_imu_and_wheels_of_two_csv_files_are_both_taken(tmp_path: Path, pelorus: Run) -> None:
    imu = SimulatedImu(imu_rate_hz=200.0, rest_s=1.5)
    drive = simulate(Options(duration_s=20.0, imu=imu, pixel_sigma_px=0.5)).recording
    files = csv_files(tmp_path, drive)[2:]  # all but the twists
    files += ["--imu", imu_csv(tmp_path, drive)]
    moving = drive.truth_velocity
    assert moving is not None
    t_ns = drive.truth_t_ns + 31_000_000  # neither of a frame nor of a reading of the IMU
    begun = t_ns > 2_000_000_000  # before the filter has started it refuses them
    t_ns, speed = t_ns[begun], moving[begun, 0]
    wheel = {"t_ns": t_ns, "vx_mps": speed, "sigma_mps": np.full(len(t_ns), 0.3)}
    target = tmp_path / "mine.plr"
    options = ("--wheel", write_csv(tmp_path / "wheel.csv", wheel))
    pelorus("convert", "csv", *files, *options, target)
    assert used_of_all(target, waits=20) > 150


def test_a_robot_that_says_that_it_rests_stays_where_it_is(tmp_path: Path) -> None:
    path = tmp_path / "parked.plr"
    resting = Options(parked=True, readings={"standstill": Sensing(rate_hz=10.0)}, duration_s=20.0)
    simulate(resting).recording.write(path)
    told = judged(path, "--mode", "dead_reckoning")
    assert told["messages_refused"] == 0
    assert told["err0_m"] < 0.01


def test_of_a_position_with_outliers_the_gate_rejects_them(drives: Drives) -> None:
    without = drives({})
    got = drives({"position": Sensing(rate_hz=5.0, drop=0.2, outliers=0.1, at_m=ARM)})
    for mode, factor in (("slam", 0.9), ("dead_reckoning", 0.2)):
        share = got[mode].gated / (got[mode].gated + got[mode].used)
        assert 0.05 < share < 0.15, mode
        assert got[mode].metres < factor * without[mode].metres
        assert NEES[0] < got[mode].nees < NEES[1], mode


def test_the_replay_tells_what_became_of_the_readings(tmp_path: Path) -> None:
    drive = clean(**SHORT)
    times = range(0, 6_000_000_000, 1_000_000_000)
    at = np.searchsorted(drive.truth_t_ns, times)
    good = [
        Reading(t, POSITION, 7, drive.truth.p[k], np.full(3, 0.1))
        for t, k in zip(times[1:], at[1:], strict=True)
    ]
    astray = [replace(good[0], t_ns=2_500_000_000, value=np.full(3, 50.0))]
    unknown = [replace(good[0], t_ns=t, sensor=200) for t in (3_500_000_000, 4_500_000_000)]
    path = tmp_path / "x.plr"
    replace(drive, readings=[*good, *astray, *unknown]).write(path)
    said = run(path)
    assert "readings      8: 5 used, 1 rejected by the gate, 2 refused" in said.stdout
    told = run(path, "--json").summary
    counts = {name: told[name] for name in told if name.startswith("readings")}
    names = ("readings", "readings_used", "readings_gated", "readings_refused")
    assert counts == dict(zip(names, (8, 5, 1, 2), strict=True))
    drive.write(path)
    assert "readings" not in run(path).stdout
    assert "readings" not in run(path, "--json").summary
