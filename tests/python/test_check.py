# SPDX-License-Identifier: MIT
"""`pelorus check`: the sigmas, timing and clock that a recording was made with are found, and what
is not there is not claimed.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from converted import Run
from draws import long_run
from pelorus.check import (
    clock,
    outcome,
    parameters,
    search,
    tracks_noise,
    tuning,
    tuning_imu,
    verdict,
)
from pelorus.check.biases import common_bias
from pelorus.check.contents import first_frames, half, recording_of, shifted
from pelorus.check.outcome import Bench, Outcome
from pelorus.check.parameters import PAYS
from pelorus.errors import PelorusError
from pelorus.io.tracks import Tracks
from pelorus.math import inertial
from pelorus.math.inertial import Inertial
from pelorus.wire import framing
from pelorus.wire.frames import (
    Header,
    Imu,
    Kind,
    Message,
    Noise,
    Pose,
    Reading,
    Report,
    Start,
    Stereo,
    Twist,
)
from replay_drive import BIN, CAMERA, drive, header
from report_runs import built_programs

MS = 1_000_000


def simulate(tmp_path_factory: pytest.TempPathFactory, *options: str) -> Path:
    """A recording for the whole module."""
    built_programs()
    from pelorus.commands.cli import main  # noqa: PLC0415 - typer is slow to load

    path = tmp_path_factory.mktemp("check") / "drive.plr"
    assert main(["simulate", str(path), *options]) == 0
    return path


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute at 20 readings a second, whose noise is not what the HEADER suggests."""
    noise = ("--pixel-sigma", "1.5", "--velocity-sigma", "0.3", "--gyro-sigma", "0.03")
    rates = ("--duration", "30", "--lap", "10", "--twist-rate", "20", "--observations", "30")
    return simulate(tmp_path_factory, "--seed", "3", *noise, *rates)


WRONG = {"pixel-sigma": "0.8", "velocity-sigma": "0.08", "gyro-sigma": "0.1"}


def said_wrong() -> list[str]:
    return [word for name, value in WRONG.items() for word in ("--set", f"{name}={value}")]


def test_sigmas_of_a_simulated_drive_are_found_within_20_percent(
    simulated: Path, tmp_path: Path, pelorus: Run
) -> None:
    conf = tmp_path / "tuned.conf"
    said = pelorus("check", simulated, "--out", conf, "--bin", BIN, "--json", *said_wrong())
    found = json.loads(said.out)
    settings = found["settings"]
    assert float(settings["pixel-sigma"]) == pytest.approx(1.5, rel=0.2)
    assert float(settings["velocity-sigma"]) == pytest.approx(0.3, rel=0.2)
    assert float(settings["gyro-sigma"]) == pytest.approx(0.03, rel=0.2)
    assert settings["twist-timing"] == "start"
    assert found["camera_offset_s"] == 0
    doubts = [remark["text"] for remark in found["remarks"] if remark["grade"] != "good"]
    assert all("cannot tell the scale" in text for text in doubts), doubts  # biases of 0.05 m/s
    figures = found["figures"]
    assert float(figures["innovations over their noise"]["after"]) == pytest.approx(1, abs=0.1)
    cost = figures["-2 ln likelihood an observation"]
    assert float(cost["after"]) < float(cost["before"])
    text = conf.read_text(encoding="utf-8")
    assert "# pixel-sigma 0.8 should be 1." in text
    again = pelorus("evaluate", simulated, "--config", conf, "--bin", BIN, status=None)
    assert again.status in (0, 1)  # it is a settings file that the replay takes
    assert "unknown" not in again.err


def test_a_camera_whose_clock_is_late_is_found(simulated: Path, tmp_path: Path) -> None:
    late = tmp_path / "late.plr"
    messages = framing.messages_of(simulated)
    kept = [m for m in messages if m.kind not in (Kind.END, Kind.TRUTH)]
    framing.write_file(late, shifted(kept, 50 * MS))
    bench = Bench(built_programs().float32, late, tmp_path)
    true = {"pixel-sigma": "1.5", "velocity-sigma": "0.3", "gyro-sigma": "0.03"}
    offset = clock.of_twists(bench, true)
    assert offset.best_s == pytest.approx(-0.05, abs=max(0.01, 3 * offset.sigma_s))
    assert offset.sigma_s < 0.01
    assert offset.gain_over(0.0) > PAYS


def test_the_timing_of_the_readings_is_found(simulated: Path, tmp_path: Path) -> None:
    bench = Bench(built_programs().float32, simulated, tmp_path)
    values = {"pixel": 1.5, "velocity": 0.3, "gyro": 0.03}
    fixed, _, words = tuning.clocked(bench, {"twist-timing": "end"}, values, {})
    assert fixed["twist-timing"] == "start", words


# --- an IMU ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute by an IMU of 100 readings a second, that turns and accelerates."""
    noise = ("--gyro-noise", "0.002", "--accel-noise", "0.1", "--pixel-sigma", "0.8")
    rates = ("--duration", "40", "--lap", "6", "--imu-rate", "100", "--observations", "40")
    return simulate(tmp_path_factory, "--seed", "7", *noise, *rates)


@long_run
def test_noises_and_clock_of_an_imu_are_found_from_wrong_ones(
    flown: Path, tmp_path: Path, pelorus: Run
) -> None:
    early = tmp_path / "early.plr"
    messages = [m for m in framing.messages_of(flown) if m.kind not in (Kind.END, Kind.TRUTH)]
    framing.write_file(early, shifted(messages, -20 * MS))
    wrong = {"pixel-sigma": "2", "gyro-noise": "0.0005", "accel-noise": "0.3"}
    sets = [word for name, value in wrong.items() for word in ("--set", f"{name}={value}")]
    conf = tmp_path / "tuned.conf"
    said = pelorus("check", early, "--out", conf, "--bin", BIN, "--json", *sets)
    found = json.loads(said.out)
    settings = found["settings"]
    assert float(settings["pixel-sigma"]) == pytest.approx(0.8, rel=0.2)
    assert float(settings["gyro-noise"]) == pytest.approx(0.002, rel=0.2)
    assert float(settings["accel-noise"]) == pytest.approx(0.1, rel=0.2)
    assert found["camera_offset_s"] == pytest.approx(0.02, rel=0.1)
    assert settings["camera-offset"] == f"{found['camera_offset_s']:.4g}"
    texts = [remark["text"] for remark in found["remarks"]]
    assert any("walk" in text and "cannot be told" in text for text in texts)
    assert "pixel-sigma, gyro-noise and accel-noise are told by the drive" in texts
    assert "# gyro-noise 0.0005 should be" in conf.read_text(encoding="utf-8")


def test_a_noise_that_a_drive_does_not_tell_is_said_and_stays() -> None:
    class Flat:
        """A bench that is blind for accel-noise, and tells the rest to a tenth; by readings that
        do not scatter.
        """

        examined = SimpleNamespace(
            inertial=Inertial(np.arange(9) * MS, np.zeros((9, 3)), np.zeros((9, 3)))
        )

        def run(self, settings: dict[str, str]) -> Outcome:
            return self.run_all([settings])[0]

        def run_all(self, many: list[dict[str, str]], what: str = "") -> list[Outcome]:
            return [self._outcome(settings, what) for settings in many]

        def _outcome(self, settings: dict[str, str], _: str) -> Outcome:
            off = [
                np.log(float(settings[k]) / v)
                for k, v in (("pixel-sigma", 1), ("gyro-noise", 1e-3))
            ]
            return replace(outcome.NOTHING, cost=50 * float(np.square(off).sum()), matched=1000)

    bench = Flat()
    values = {"pixel": 1.0, "gyro": 1e-3, "accel": 4e-4}
    usual = bench.run(parameters.written(values, parameters.IMU))
    given = {"pixel": 2.0, "gyro": 5e-3, "accel": 2e-2}
    found, words = tuning_imu.noises(bench, {}, search.BestFound(values, usual), given)  # type: ignore[arg-type]
    assert found.values == {"pixel": 1.0, "gyro": 1e-3, "accel": 2e-2}
    assert words.startswith(
        "accel-noise cannot be told within 3 times by this drive (0.02 is written)"
    )
    small = {**given, "accel": 4e-5}  # which would have the IMU believed more
    kept, _ = tuning_imu.noises(bench, {}, search.BestFound(values, usual), small)  # type: ignore[arg-type]
    assert kept.values == values


def test_every_offset_of_an_imu_is_judged_by_the_same_frames(flown: Path, tmp_path: Path) -> None:
    bench = Bench(built_programs().float32, flown, tmp_path)
    assert bench.by_imu
    quick = {outcome.LENGTH: "60", "slots": "15"}
    ran = bench.run_all([{**quick, outcome.OFFSET: f"{at:g}"} for at in (-0.1, 0.0, 0.1)])
    assert len({run.frames for run in ran}) == 1
    assert bench.run({**quick, "camera-offset": "0.1"}).cost == ran[2].cost


def test_a_batch_of_readings_does_not_reach_over_a_frame_that_was_moved(flown: Path) -> None:
    messages = shifted(first_frames(framing.messages_of(flown), 30), 33 * MS)
    newest = 0
    for message in messages:
        if isinstance(message, Imu):
            assert message.t_ns > newest or message.t_ns == 0
            newest = message.times_ns[-1]
        elif isinstance(message, Stereo):
            assert newest <= message.t_ns
    given = [t for m in framing.messages_of(flown) if isinstance(m, Imu) for t in m.times_ns]
    kept = [t for m in messages if isinstance(m, Imu) for t in m.times_ns]
    assert kept == given[: len(kept)]


def test_moved_frames_leave_readings_beside_an_imu_in_their_place() -> None:
    """None is later than what stands before it, and of one time the IMU's stands first."""
    t_ns = np.arange(200) * 5 * MS
    rows = np.tile([0.0, 0, 9.81], (len(t_ns), 1))
    wheel = [Reading(int(t), 1, 1, sigma=np.full(3, 0.1)) for t in t_ns[::4]]
    wheel += [replace(m, t_ns=m.t_ns + 7 * MS) for m in wheel]
    pixels = np.zeros((1, 4), np.float32)
    frames = [Stereo(100 * k * MS, np.zeros(1, np.uint32), pixels) for k in range(1, 10)]
    batches = [m for _, m in inertial.messages(Inertial(t_ns, rows, 0 * rows), np.empty(0, int))]
    ranks = {Imu: 0, Reading: 1, Stereo: 2}
    last, held = (0, 0), 0
    for message in shifted([header(), *batches, *wheel, *frames], 33 * MS)[1:]:
        assert isinstance(message, Imu | Reading | Stereo)
        assert last <= (message.t_ns, ranks[type(message)]), message
        last = (message.times_ns[-1] if isinstance(message, Imu) else message.t_ns), 0
        held += isinstance(message, Reading)
    assert held == len(wheel)


def test_the_foot_of_a_parabola_and_how_sure_it_is() -> None:
    at = np.linspace(-0.03, 0.03, 7)
    offset = clock.foot(at, 7.0 + ((at - 0.004) / 0.002) ** 2)
    assert offset.best_s == pytest.approx(0.004)
    assert offset.sigma_s == pytest.approx(0.002)
    assert offset.gain_over(0.0) == pytest.approx(4.0)
    jumping = clock.foot(at, ((at - 0.004) / 0.002) ** 2 + 40 * np.array([0, 1, 0, 1, 0, 1, 0]))
    assert jumping.sigma_s > offset.sigma_s  # a parabola that does not fit is not believed
    assert clock.foot(at, -(at**2)).sigma_s == np.inf
    feet = np.array([-0.02, 0.02] * 10)  # parts of a drive that do not agree on the foot
    parts = ((at[:, None] - feet) / 0.002) ** 2
    apart = clock.foot(at, parts)
    assert apart.best_s == pytest.approx(0, abs=1e-9)
    assert apart.sigma_s == pytest.approx(0.02 / np.sqrt(19), rel=0.05)
    assert clock.foot(at, parts.sum(axis=1)).sigma_s < 0.001
    assert clock.foot(at[:2], at[:2]).gain_over(0.0) == 0


# --- what the likelihood is made of ---------------------------------------------------------------


def report(t: int, **counts: float) -> Report:
    return Report(t, Kind.STEREO, **counts)  # type: ignore[arg-type]


def test_a_gated_observation_costs_what_one_anywhere_would() -> None:
    good = report(1, matched=10, used=10, innovation_rows=30, innovation_d2=30.0)
    pose = Pose(1, after_stereo=True)

    def of(*reports: Report) -> outcome.Outcome:
        frames = [framing.encode(m, 0).rstrip(b"\0") for m in reports]
        return outcome.outcome_of(framing.rows_of(frames, Kind.REPORT), pose, 40.0)

    base = of(good)
    assert base.nis == 1.0
    assert of(replace(good, gated=1)).cost - base.cost == pytest.approx(4.0)
    assert of() is outcome.NOTHING
    assert of(good, replace(good, status=-6)).matched == 10


def test_any_run_is_likelier_than_one_that_used_nothing() -> None:
    some = replace(outcome.NOTHING, cost=10.0, matched=1000)
    assert some.gain_over(outcome.NOTHING) == np.inf
    assert outcome.NOTHING.gain_over(some) == -np.inf
    assert outcome.NOTHING.gain_over(outcome.NOTHING) == 0


def test_an_outlier_may_lie_anywhere_in_the_picture() -> None:
    frames = drive()
    sized = header(image_width_px=640, image_height_px=480)
    cost = outcome.outlier_cost(sized, frames)
    assert cost == pytest.approx(2 * np.log(640 * 480 * outcome.DISPARITY_SPAN_PX))
    spread = outcome.outlier_cost(header(), frames)  # then as far as the pixels lie apart
    assert spread == pytest.approx(cost, abs=1)


# --- the search -----------------------------------------------------------------------------------


class Bowl:
    """A bench whose cost is known: a bowl about (3, 0.2) in the logarithms."""

    def __init__(self) -> None:
        self.asked = 0

    def run(self, settings: dict[str, str]) -> Outcome:
        return self.run_all([settings])[0]

    def run_all(self, many: list[dict[str, str]], what: str = "") -> list[Outcome]:
        self.asked += len(many) + 0 * len(what)
        return [self._outcome(settings) for settings in many]

    def _outcome(self, settings: dict[str, str]) -> Outcome:
        a, b = np.log(float(settings["a"]) / 3), np.log(float(settings["b"]) / 0.2)
        return replace(outcome.NOTHING, cost=float(a * a + 0.3 * a * b + b * b), matched=1000)


def test_the_search_finds_the_foot_of_a_bowl_from_far_away() -> None:
    bowl = Bowl()
    found = search.search(
        bowl,  # type: ignore[arg-type]
        {"a": 0.1, "b": 7.0},
        {"a": (1e-3, 1e3), "b": (1e-3, 1e3)},
        lambda values: {name: repr(value) for name, value in values.items()},
        (2.0, 2.0, 1.5, 1.25),
    )
    assert found.values["a"] == pytest.approx(3, rel=0.05)
    assert found.values["b"] == pytest.approx(0.2, rel=0.05)
    assert bowl.asked < 120


def test_the_foot_of_three_points_is_that_of_their_parabola() -> None:
    assert search.foot(1.0, 0.0, 1.0) == 0
    assert search.foot(2.25, 0.25, 0.25) == pytest.approx(0.5)
    assert search.foot(0.0, 1.0, 2.0) == -1  # a slope without a foot: a step downhill
    assert search.foot(1.0, 1.0, 1.0) == 0
    assert search.foot(np.inf, 1.0, 2.0) == 0


# --- noises as settings ---------------------------------------------------------------------------


def test_the_search_begins_with_each_axis_own_sigma_where_they_differ() -> None:
    blind = header(noise=Noise(velocity_sigma_mps=0.1, velocity_sigma_y_mps=0.2))
    values = parameters.starting(blind, {"gyro-sigma": "0.01,0.02,0.03"}, parameters.TWIST)
    assert values["pixel"] == 2.0
    assert [values[f"velocity-{axis}"] for axis in "xyz"] == [0.1, 0.2, 0.1]
    assert [values[f"gyro-{axis}"] for axis in "xyz"] == [0.01, 0.02, 0.03]
    settings = parameters.written(values, parameters.TWIST)
    assert settings["velocity-sigma"] == "0.1,0.2,0.1"
    assert parameters.starting(blind, settings, parameters.TWIST) == values
    assert parameters.pooled(values, "velocity") == pytest.approx(0.1 * 2 ** (1 / 3))


def test_of_few_frames_is_said_what_they_cannot_tell() -> None:
    (remark,) = verdict.of_length(51)
    assert remark.grade is verdict.Grade.CARE
    assert remark.text.startswith("only 51 frames")
    assert not list(verdict.of_length(100))


# --- biases, tracks, parts ------------------------------------------------------------------------


def test_a_bias_must_be_told_by_both_halves_alike() -> None:
    bias, variance = np.array([0.010, -0.012, 0.009]), np.full(3, 1e-6)
    told = common_bias(bias, variance, 1.1 * bias, variance)
    assert told.size == pytest.approx(0.011, rel=0.1)
    assert told.known == pytest.approx(1e-3 / np.sqrt(2))
    assert common_bias(bias, variance, -bias, variance).size == 0
    assert common_bias(bias, variance, np.roll(bias, 1) * [1, -1, 1], variance).size == 0
    assert common_bias(bias, 1e4 * variance, bias, 1e4 * variance).size == 0  # may be chance
    assert common_bias(bias, -np.ones(3), bias, variance).size == 0  # not known


def moving_tracks(drift_px: float) -> list[Message]:
    """A circle's drive whose pixels are off by a random walk, or by noise that is new each time."""
    chance = np.random.default_rng(2)
    messages = drive(120, sigma_px=0.0)
    off: dict[int, np.ndarray] = {}
    out: list[Message] = []
    for message in messages:
        if isinstance(message, Stereo):
            shifts = []
            for id in message.ids.tolist():
                new = chance.normal(0, 0.3, 4)
                off[id] = off.get(id, np.zeros(4)) + drift_px * chance.normal(size=4)
                shifts.append(new + off[id])
            pixels = message.pixels + np.array(shifts).reshape(-1, 4)
            message = replace(message, pixels=pixels.astype(np.float32))  # noqa: PLW2901
        out.append(message)
    return out


def test_tracks_that_drift_are_told_from_white_noise() -> None:
    white = tracks_noise.track_noise(recording_of(moving_tracks(0.0)))
    assert not white.drifts
    assert white.by_lag[1] == pytest.approx(0.3, rel=0.2)
    recording = recording_of(moving_tracks(0.3))
    drifting = tracks_noise.track_noise(recording)
    assert drifting.drifts
    assert drifting.stands_for_px > 2 * drifting.by_lag[1]
    assert not white.setting({})
    assert not drifting.setting({"model": "world"})  # which has no such setting
    tau_s = 1e-9 * np.median(np.diff(recording.frame_t_ns))
    told = float(drifting.setting({})["track-drift"])
    # all four rows wander here, each by itself; it knows drifts that both pictures share
    due = np.sqrt(2) * 0.3 / np.sqrt(tau_s)
    assert told == pytest.approx(0.7 * due, rel=0.25)
    assert drifting.setting({"track-drift": f"{due:.2f}"}) == {"track-drift": f"{due:.2f}"}
    assert float(drifting.setting({"track-drift": f"{5 * due:.2f}"})["track-drift"]) == told


@long_run
def test_a_drive_whose_tracks_drift_is_honest_afterwards(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, pelorus: Run
) -> None:
    path = simulate(
        tmp_path_factory, "--seed", "1", "--track-drift", "2", "--pixel-sigma", "0.5",
        "--duration", "40",
    )  # fmt: skip
    said = pelorus("check", path, "--out", tmp_path / "t.conf", "--bin", BIN, "--json")
    found = json.loads(said.out)
    assert float(found["settings"]["track-drift"]) == pytest.approx(1.4, rel=0.3)
    assert any("track-drift" in remark["text"] for remark in found["remarks"])
    nees = found["figures"]["NEES/6"]
    assert float(nees["before"]) > 3 > 2 * float(nees["after"])


def test_too_few_points_seen_twice_tell_nothing_of_drift() -> None:
    few = recording_of(drive(3))
    tracks = Tracks.from_rows(3, few.tracks.frame[:9], few.tracks.id[:9], few.tracks.pixels[:9])
    found = tracks_noise.track_noise(replace(few, tracks=tracks))
    assert np.isnan(found.growth)
    assert not found.drifts


def test_parts_of_a_recording_keep_its_header_and_its_order() -> None:
    messages = [header(), Start(0), *drive(40)[1:]]
    first, second = half(messages, 0), half(messages, 1)
    assert isinstance(first[0], Header)
    assert isinstance(second[0], Header)
    assert not any(isinstance(m, Start) for m in second)
    count = [sum(isinstance(m, Stereo) for m in part) for part in (first, second)]
    assert count == [20, 20]
    assert sum(isinstance(m, Stereo) for m in first_frames(messages, 7)) == 7
    late = shifted(first_frames(messages), 30 * MS)
    times = [m.t_ns for m in late if isinstance(m, Stereo | Twist)]
    assert times == sorted(times)
    early = shifted([header(), Stereo(5, np.zeros(0, np.uint32), np.zeros((0, 4), np.float32))], -9)
    assert len(early) == 1  # before time zero


def test_what_no_filter_takes_is_left_out_of_what_is_examined() -> None:
    messages = drive(10)
    bad = Stereo(1, np.zeros(1, np.uint32), np.zeros((1, 4), np.float32))  # time goes back
    frames = [m for m in messages if isinstance(m, Stereo)]
    frames[3] = replace(frames[3], pixels=np.full_like(frames[3].pixels, np.nan))
    twists = [m for m in messages if isinstance(m, Twist)]
    found = recording_of([header(), *twists, *frames, bad])
    assert found.tracks.frame_count == 10
    assert np.isfinite(found.tracks.pixels).all()
    assert found.header.camera == CAMERA


@pytest.mark.parametrize("kind", [Twist, Stereo])
def test_a_recording_with_nothing_to_check_says_what_it_lacks(
    tmp_path: Path, pelorus: Run, kind: type[Message]
) -> None:
    path = tmp_path / "x.plr"
    framing.write_file(path, [m for m in drive(5) if not isinstance(m, kind)])
    said = pelorus("check", path, "--out", tmp_path / "t.conf", "--bin", BIN, status=1)
    assert ("no twists" if kind is Twist else "no stereo frames") in said.err
    assert not (tmp_path / "t.conf").exists()


def test_a_folder_is_refused_with_what_would_be_right(tmp_path: Path, pelorus: Run) -> None:
    said = pelorus("check", tmp_path, "--out", tmp_path / "t.conf", "--bin", BIN, status=1)
    words = " ".join(said.err.split())
    assert "is a folder, a recording is a .plr file: `pelorus convert` makes one" in words
    assert not (tmp_path / "t.conf").exists()


def test_an_unknown_setting_is_refused_by_the_recordings_name(tmp_path: Path, pelorus: Run) -> None:
    path = tmp_path / "x.plr"
    framing.write_file(path, drive(30))
    options = ("--set", "unknown=1", "--out", tmp_path / "t.conf", "--bin", BIN)
    said = pelorus("check", path, *options, status=1)
    assert "--unknown: unknown option" in said.err
    assert "".join(said.err.split()).startswith(f"error:{path}:")


def test_a_settings_file_that_is_none_is_refused_by_line(tmp_path: Path, pelorus: Run) -> None:
    path, conf = tmp_path / "x.plr", tmp_path / "bad.conf"
    framing.write_file(path, drive(5))
    conf.write_text("# mine\npixel-sigma 2\n", encoding="utf-8")
    said = pelorus(
        "check", path, "--config", conf, "--out", tmp_path / "t.conf", "--bin", BIN, status=1
    )
    assert "bad.conf: line 2: 'pixel-sigma 2' is not name = value" in said.err
    with pytest.raises(PelorusError, match="no stereo frames"):
        recording_of([header(), Twist(0)])
