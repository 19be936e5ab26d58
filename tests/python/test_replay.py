# SPDX-License-Identifier: MIT
"""pelorus-replay as a user meets it: results, modes, settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.evaluate.evaluation import judge
from pelorus.wire import settings
from pelorus.wire.frames import (
    Config,
    Kind,
    Message,
    Noise,
    Report,
    Start,
    Stereo,
    Truth,
    Twist,
)
from replay_drive import (
    FRAMES,
    RECORDING,
    SPEED,
    USAGE,
    Record,
    bits_of,
    drive,
    encode,
    header,
    judged,
    known,
    log_of,
    poses_of,
    run,
    t_ns,
    true_pose,
)

# --- results --------------------------------------------------------------------------------------


def test_a_gate_that_turns_away_too_much_is_told_with_what_to_do(record: Record) -> None:
    path = record(drive(sigma_px=0.5))
    sound = run(path, "--pixel-sigma", "0.5")
    assert "hint" not in sound.stdout
    too_sure = run(path, "--pixel-sigma", "0.1")
    assert "hint: of sound observations this gate turns away 1 %." in too_sure.stdout
    for word in ("extrinsic", "ids:", "--camera-offset", "--pixel-sigma", "pelorus check"):
        assert word in too_sure.stdout
    assert "hint" not in run(path, "--pixel-sigma", "0.1", "--gate", "off").stdout
    assert "hint" not in run(path, "--pixel-sigma", "0.1", "--gate-residual", "1e-3").stdout


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
def test_a_drive_is_followed_and_summed_up(record: Record, program: str) -> None:
    path = record(drive())
    assert run(path, program=program).stderr == ""
    summary = judged(path, program=program)
    assert summary["frames"] == FRAMES
    assert summary["precision"] == ("float64" if program.endswith("f64") else "float32")
    assert summary["err0_m"] < 0.1
    assert summary["ate_m"] < summary["err0_m"] + 1e-9
    assert summary["used"] > 10 * FRAMES
    assert summary["path_m"] == pytest.approx(0.1 * SPEED * (FRAMES - 1), rel=0.05)
    assert summary["duration_s"] == pytest.approx(0.1 * (FRAMES - 1))
    assert 0 < summary["update_us_median"] <= summary["update_us_p99"] <= summary["update_us_max"]
    assert summary["realtime_factor"] > 1
    assert summary["ended"] is True
    assert all(summary[key] == 0 for key in ("damaged", "missing", "messages_refused", "warnings"))


def test_the_human_summary_says_the_same(record: Record) -> None:
    path = record(drive())
    summary, text = run(path, "--json").summary, run(path).stdout
    assert f"{summary['frames']} used" in text
    assert f"{summary['observations']}: {summary['used']} used" in text
    assert f"path          {summary['path_m']:.1f} m" in text
    assert "pelorus evaluate" in text  # who tells how true it is
    assert run(path, "--quiet").stdout == ""


def test_the_figures_of_a_log_are_those_of_its_poses(record: Record, tmp_path: Path) -> None:
    """From the same start, so that the world needs no alignment."""
    path, out = record(drive()), tmp_path / "out.plr"
    summary = run(path, "--json", "--out", out).summary
    p = np.array([pose.p_WB_m for pose in poses_of(out)])
    off = np.linalg.norm(p - np.array([true_pose(k)[1] for k in range(FRAMES)]), axis=1)
    figures = judge(log_of(out))
    assert figures["err0_m"] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)
    length = np.linalg.norm(np.diff(p, axis=0), axis=1).sum()
    assert summary["path_m"] == pytest.approx(length, rel=1e-6)


def test_without_truth_the_figures_are_null(record: Record) -> None:
    path = record([m for m in drive() if m.kind != Kind.TRUTH])
    summary = judged(path)
    assert all(summary[key] is None for key in ("err0_m", "ate_m", "rot_deg", "nees_per_dof"))
    assert summary["truth_frames"] == 0
    assert "accuracy" not in run(path).stdout


def test_the_trajectory_agrees_with_the_log(record: Record, tmp_path: Path) -> None:
    tum, out = tmp_path / "a.tum", tmp_path / "a.plr"
    options = ("--trajectory", tum, "--out", out, "--slots", "12")
    run(record(drive()), *options, "--quiet")
    poses = poses_of(out)
    trajectory = np.loadtxt(tum)
    assert trajectory.shape == (FRAMES, 8)
    assert np.allclose(trajectory[:, 1:4], [p.p_WB_m for p in poses], atol=1e-6)
    assert np.allclose(np.linalg.norm(trajectory[:, 4:], axis=1), 1, atol=1e-6)
    assert tum.read_text().split()[0] == "5.000000000"


def test_a_log_replays_to_the_same_bits_with_its_own_settings(
    record: Record, tmp_path: Path
) -> None:
    first, second = tmp_path / "1.plr", tmp_path / "2.plr"
    options = ("--slots", "9", "--bias", "on", "--pixel-sigma", "0.7", "--twist-timing", "mid")
    run(record(drive()), "--out", first, *options, "--quiet")
    result = run(first, "--out", second, "--json")
    assert result.summary["slots"] == 9
    assert bits_of(first) == bits_of(second)
    assert [m.kind for m in log_of(first)] == [m.kind for m in log_of(second)]


def test_answers_alone_are_those_of_the_whole_log(record: Record, tmp_path: Path) -> None:
    recording, whole, alone = record(drive(20)), tmp_path / "log.plr", tmp_path / "answers.plr"
    run(recording, "--out", whole)
    run(recording, "--answers", "--out", alone)
    answers = [untimed(m) for m in log_of(alone)]
    assert {m.kind for m in answers} == {Kind.POSE, Kind.REPORT}
    assert answers == [untimed(m) for m in log_of(whole) if m.kind in (Kind.POSE, Kind.REPORT)]


def untimed(message: Message) -> Message:
    """The message without what differs from run to run."""
    return replace(message, update_us=0) if isinstance(message, Report) else message


def test_a_log_of_another_build_says_that_the_bits_may_differ(
    record: Record, tmp_path: Path
) -> None:
    """With another capacity the bits are normally the same, with another precision they are not."""
    log = tmp_path / "1.plr"
    run(record(drive()), "--out", log, "--quiet")
    assert "another build" not in run(log).stderr
    said = run(log, program="pelorus-replay-f64").stderr
    assert "this log comes from another build (precision, capacity or version)" in said
    assert "the settings are taken, the bits may differ" in said


@pytest.mark.parametrize("mode", ["slam", "dead_reckoning"])
def test_what_is_written_changes_no_bit(record: Record, tmp_path: Path, mode: str) -> None:
    path, plain, full = record(drive()), tmp_path / "1.plr", tmp_path / "2.plr"
    run(path, "--mode", mode, "--out", plain, "--quiet")
    others = ("--trajectory", tmp_path / "t")
    run(path, "--mode", mode, "--out", full, *others, "--json")
    assert bits_of(plain) == bits_of(full)


def test_the_order_of_observations_changes_no_bit(record: Record, tmp_path: Path) -> None:
    messages = drive()
    run(record(messages), "--out", tmp_path / "1.plr", "--quiet")
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            order = np.random.default_rng(i).permutation(len(m.ids))
            messages[i] = replace(m, ids=m.ids[order], pixels=m.pixels[order])
    run(record(messages), "--out", tmp_path / "2.plr", "--quiet")
    assert bits_of(tmp_path / "1.plr") == bits_of(tmp_path / "2.plr")


def test_the_standard_input_is_a_recording_too() -> None:
    result = run("-", "--json", stdin=encode(drive()))
    assert result.summary["frames"] == FRAMES


# --- modes ----------------------------------------------------------------------------------------


def test_mapping_takes_the_truth_and_leaves_out_frames_without(
    record: Record, tmp_path: Path
) -> None:
    messages = [m for m in drive() if not (isinstance(m, Truth) and m.t_ns in (t_ns(7), t_ns(8)))]
    log = tmp_path / "log.plr"
    path = record(messages)
    result = run(path, "--mode", "mapping", "--json", "--out", log)
    summary = result.summary | judge(log_of(log))
    assert (summary["frames"], summary["without_truth"]) == (FRAMES - 2, 2)
    given = {m.t_ns: m.p_WB_m for m in messages if isinstance(m, Truth)}
    assert all(np.abs(pose.p_WB_m - given[pose.t_ns]).max() < 1e-5 for pose in poses_of(log))
    assert summary["err0_m"] is None  # the poses are given: no figure of the filter's
    assert summary["nees_per_dof"] is None
    assert "needs a TRUTH of equal time" in result.stderr


def test_localization_beats_slam_and_dead_reckoning(record: Record) -> None:
    messages = drive(sigma_px=1.0)
    for i, m in enumerate(messages):
        if isinstance(m, Twist):
            noise = np.random.default_rng(i).normal(size=6)
            messages[i] = Twist(m.t_ns, m.v_B_mps + 0.3 * noise[:3], m.w_B_radps + 0.05 * noise[3:])
    path = record([messages[0], *known(), *messages[1:]])
    noise_options = ("--velocity-sigma", "0.3", "--gyro-sigma", "0.05", "--pixel-sigma", "1")
    error = {
        mode: judged(path, "--mode", mode, *noise_options)["err0_m"]
        for mode in ("slam", "localization", "dead_reckoning")
    }
    assert error["localization"] < error["slam"] < error["dead_reckoning"]


def test_known_landmarks_are_for_localization_unless_slam_asks(record: Record) -> None:
    path = record([header(), *known(), *drive()[1:]])
    plain = judged(path)
    asked = judged(path, "--known-map", "on")
    assert plain["new"] > 0
    assert asked["err0_m"] < plain["err0_m"]


def test_start_can_be_chosen(record: Record, tmp_path: Path) -> None:
    rotation, position = true_pose(20)
    messages = [header(), Start(t_ns(0), rotation, position), *drive()[1:]]
    first = {}
    for choice in ("auto", "recorded", "truth", "identity"):
        out = tmp_path / f"{choice}.plr"
        run(record(messages), "--start", choice, "--out", out, "--quiet")
        first[choice] = poses_of(out)[0].p_WB_m
    assert np.allclose(first["auto"], position)
    assert np.allclose(first["recorded"], position)
    assert np.allclose(first["truth"], 0)
    assert np.allclose(first["identity"], 0)
    result = run(record(drive()), "--start", "recorded", status=RECORDING)
    assert "--start asks for" in result.stderr


# --- settings -------------------------------------------------------------------------------------


def printed(*arguments: str | Path) -> dict[str, str]:
    result = run(*arguments, "--print-config")
    lines = (line.split("#")[0] for line in result.stdout.splitlines())
    pairs = (line.split("=") for line in lines)
    return {name.strip(): value.strip() for name, value in pairs}


def test_the_settings_are_those_of_the_format() -> None:
    assert list(printed()) == [
        setting.name for setting in settings.SETTINGS.values() if not setting.of_axis
    ]


def test_sigmas_of_three_axes_are_taken_and_printed(record: Record, tmp_path: Path) -> None:
    noise = Noise(gyro_sigma_radps=0.3, gyro_sigma_y_radps=0.2, velocity_sigma_mps=0.7)
    path = record([header(noise=noise), *drive()[1:]])
    assert printed(path)["gyro-sigma"] == "0.3, 0.2, 0.3"
    assert printed(path)["velocity-sigma"] == "0.7"
    conf = tmp_path / "robot.conf"
    conf.write_text("gyro-sigma = 0.1, 0.13, 0.42  # x, y, z\n")
    got = printed(path, "--config", conf, "--velocity-sigma", "0.5,0.25,0.5")
    assert got["gyro-sigma"] == "0.1, 0.13, 0.42"
    assert got["velocity-sigma"] == "0.5, 0.25, 0.5"
    assert printed(path, "--config", conf, "--gyro-sigma", "0.1")["gyro-sigma"] == "0.1"
    given = ("--gyro-sigma", "0.1,0.2,0.3", "--gyro-sigma", "0.4")
    assert printed(path, *given)["gyro-sigma"] == "0.4", "the last one counts, for all axes"


def test_option_wins_over_file_over_config_over_header_over_default(
    record: Record, tmp_path: Path
) -> None:
    conf = tmp_path / "robot.conf"
    conf.write_text("# settings\ngyro-sigma = 0.3\nvelocity-sigma = 0.3  # m/s\n")
    noise = Noise(0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
    wanted = Config({8: 0.5, 9: 0.2, 10: 0.2, 11: 0.2})
    path = record([header(noise=noise), wanted, *drive()[1:]])
    got = printed(path, "--config", conf, "--gyro-sigma", "0.4")
    assert got["gyro-sigma"] == "0.4"
    assert got["velocity-sigma"] == "0.3"
    assert got["bias-velocity-sigma"] == "0.2"
    assert got["bias-gyro-sigma"] == "0.1"
    assert got["max-gap"] == printed()["max-gap"]


def test_printed_settings_are_a_config_file(record: Record, tmp_path: Path) -> None:
    path, conf = record(drive()), tmp_path / "printed.conf"
    options = ("--model", "world", "--bias", "on", "--slots", "17", "--gate", "0.95")
    conf.write_text(run(path, *options, "--print-config").stdout)
    assert printed(path, "--config", conf) == printed(path, *options)


def test_the_course_preset_is_the_reports(record: Record) -> None:
    got = printed(record(drive()), "--preset", "course")
    assert (got["model"], got["bias"], got["twist-timing"]) == ("world", "off", "start")
    assert got["noise"] == "step"
    assert float(got["landmark-sigma"]) ** 2 == pytest.approx(2)
    assert float(got["start-sigma"]) ** 2 == pytest.approx(5e-4)
    assert float(got["pixel-sigma"]) ** 2 == pytest.approx(5)
    assert float(got["velocity-sigma"]) ** 2 == pytest.approx(1e-3)
    assert float(got["gyro-sigma"]) ** 2 == pytest.approx(1e-3)
    assert got["landmark-prior"] == "independent"
    assert (got["gate-residual"], got["max-depth"]) == ("20", "30")
    changed = printed(record(drive()), "--pixel-sigma", "3", "--preset", "course")
    assert changed["pixel-sigma"] == "3"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--gate", "1.5"), "a probability above 0 and below 1, or off"),
        (("--model", "mars"), "body or world"),
        (("--slots", "0"), "a whole number from 1"),
        (("--pixel-sgima", "1"), "--pixel-sigma"),
        (("--config", "no/such/file"), "no/such/file"),
        (("--landmark-sigma", "1"), "landmark-sigma"),
        (("--gyro-sigma", "0.1,0.2"), "from 0 to 100 rad/s, or three with commas: x,y,z"),
        (("--gyro-sigma", "0.1,0.2,0.3,"), "three with commas"),
        (("--gyro-sigma", "0.1,0.2,0.3,0.4"), "three with commas"),
        (("--gyro-sigma", "0.1,,0.3"), "three with commas"),
        (("--gyro-sigma", "0.1,0.2,-1"), "three with commas"),
        (("--pixel-sigma", "1,2,3"), "a number from 0.001 to 1000 px"),
        (("--landmark-prior", "independent"), "landmark-prior"),
        (("--model", "world", "--landmark-prior", "independent"), "landmark-sigma"),
    ],
)
def test_options_without_sense_are_refused_by_name(
    record: Record, arguments: tuple[str, ...], words: str
) -> None:
    result = run(record(drive(2)), *arguments, status=USAGE)
    assert words in result.stderr


def test_help_and_version_tell_all() -> None:
    shown = run("--help")
    for setting in settings.SETTINGS.values():
        assert (f"--{setting.name} " in shown.stdout) is not bool(setting.of_axis)
    for name in ("gate", "preset", "start", "config", "trajectory", "out", "json"):
        assert f"--{name}" in shown.stdout
    assert "float64" in run("--version", program="pelorus-replay-f64").stdout


def test_words_in_a_recording_do_not_command_the_terminal(record: Record) -> None:
    messages = drive()
    messages[0] = replace(header(), name="\x1b[31mred\x07 \x9b1m café")
    said = run(record(messages)).stdout
    assert r"(\x1b[31mred\x07 \x9b1m café), " in said
    assert all(c.isprintable() or c == "\n" for c in said)
