# SPDX-License-Identifier: MIT
"""pelorus-replay as a user meets it: its outputs, its figures, its messages, and bad input.

The programs are looked for in $PELORUS_BIN, by default build/bin.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import struct
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pelorus import figures as reference
from pelorus import settings, wire
from pelorus.frames import (
    Camera,
    Config,
    Header,
    Kind,
    Landmark,
    Message,
    Noise,
    Pose,
    Report,
    Role,
    Start,
    Stereo,
    Text,
    Truth,
    Twist,
)
from pelorus.se3 import Poses

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("PELORUS_BIN", ROOT / "build" / "bin"))

OK, RECORDING, USAGE, OUTPUT = 0, 1, 2, 3  # exit statuses
SECOND = 1_000_000_000
FRAMES = 40
CAMERA = Camera(fx_px=320, fy_px=320, cx_px=320, cy_px=240, baseline_m=0.25)
R_CB = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])
SPEED, RATE = 1.0, 0.2  # round a circle
STRANGE = (math.nan, math.inf, -math.inf, 1e300, -1e300)


# --- a drive --------------------------------------------------------------------------------------


def t_ns(k: int) -> int:
    return 5 * SECOND + k * SECOND // 10


def true_pose(k: int) -> tuple[Any, Any]:
    a = RATE * 0.1 * k
    rotation = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    radius = SPEED / RATE
    return rotation, np.array([radius * math.sin(a), radius * (1 - math.cos(a)), 0])


def points() -> Any:
    chance = np.random.default_rng(1)
    angle, reach = chance.uniform(0, 2 * math.pi, 200), chance.uniform(7, 20, 200)
    height = chance.uniform(-3, 3, 200)
    return np.stack([reach * np.cos(angle), 5 + reach * np.sin(angle), height], 1)


def stereo(k: int, sigma_px: float = 0.0) -> Stereo:
    rotation, position = true_pose(k)
    q = (points() - position) @ rotation @ R_CB.T
    seen = np.nonzero((q[:, 2] > 2) & (abs(q[:, 0]) < q[:, 2]) & (abs(q[:, 1]) < q[:, 2]))[0][:30]
    x, y, z = q[seen].T
    left, right = 320 * x / z + 320, 320 * (x - 0.25) / z + 320
    v = 320 * y / z + 240
    pixels = np.stack([left, v, right, v], 1)
    pixels += sigma_px * np.random.default_rng(100 + k).normal(size=pixels.shape)
    return Stereo(t_ns(k), seen.astype(np.uint32), pixels.astype(np.float32))


def twist(k: int) -> Twist:
    return Twist(t_ns(k), np.array([SPEED, 0, 0]), np.array([0, 0, RATE]))


def truth(k: int) -> Truth:
    return Truth(t_ns(k), *true_pose(k))


def header(**changes: Any) -> Header:
    return replace(Header(CAMERA, R_CB, name="circle"), **changes)


def drive(frames: int = FRAMES, sigma_px: float = 0.5) -> list[Message]:
    messages: list[Message] = [header()]
    for k in range(frames):
        messages += [twist(k), truth(k), stereo(k, sigma_px)]
    return messages


def later(message: Message, seconds: int) -> Twist | Truth | Stereo:
    assert isinstance(message, Twist | Truth | Stereo)
    return replace(message, t_ns=message.t_ns + seconds * SECOND)


def encode(messages: Iterable[Message], end: bool = True) -> bytes:
    stream = io.BytesIO()
    writer = wire.Writer(stream)
    for message in messages:
        writer.write(message)
    if end:
        writer.end()
    return stream.getvalue()


# --- running it -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Result:
    """What one run gave."""

    status: int
    stdout: str
    stderr: str

    @property
    def summary(self) -> dict[str, Any]:
        loaded = json.loads(self.stdout)
        assert isinstance(loaded, dict)
        return loaded


def run(*arguments: str | Path, program: str = "pelorus-replay", stdin: bytes = b"") -> Result:
    path = BIN / program
    if not path.exists():
        pytest.skip(f"{path} is not built")
    command = [str(path), *map(str, arguments)]
    done = subprocess.run(command, input=stdin, capture_output=True, check=False, timeout=60)
    assert done.returncode >= 0, f"killed by signal {-done.returncode}"
    return Result(done.returncode, done.stdout.decode(), done.stderr.decode())


Record = Callable[[Iterable[Message] | bytes], Path]


@pytest.fixture
def record(tmp_path: Path) -> Record:
    def write(content: Iterable[Message] | bytes) -> Path:
        path = tmp_path / "drive.plr"
        path.write_bytes(content if isinstance(content, bytes) else encode(content))
        return path

    return write


def log_of(path: Path) -> list[Message]:
    received, counts = wire.read_file(path)
    assert counts.clean
    return [frame.message for frame in received]


def poses_of(path: Path) -> list[Pose]:
    return [message for message in log_of(path) if isinstance(message, Pose)]


def bits_of(path: Path) -> str:
    return hashlib.sha256(b"".join(pose.pack() for pose in poses_of(path))).hexdigest()


def assert_healthy(path: Path) -> int:
    """Every pose is made of numbers, every variance positive; gives the number of poses."""
    poses = poses_of(path)
    diagonal = [i * (i + 3) // 2 for i in range(6)]
    for pose in poses:
        numbers = (pose.p_WB_m, pose.R_WB, pose.covariance, pose.v_B_mps, pose.w_B_radps, pose.bias)
        assert all(np.isfinite(part).all() for part in numbers)
        assert (pose.covariance[diagonal] > 0).all()
        assert np.allclose(pose.R_WB @ pose.R_WB.T, np.eye(3), atol=1e-5)
    return len(poses)


# --- results --------------------------------------------------------------------------------------


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
def test_a_drive_is_followed_and_summed_up(record: Record, program: str) -> None:
    result = run(record(drive()), "--json", program=program)
    assert result.status == OK, result.stderr
    assert result.stderr == ""
    summary = result.summary
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
    assert f"err0 {summary['err0_m']:.3f} m" in text
    assert f"NEES/6 {summary['nees_per_dof']:.2f}" in text
    assert run(path, "--quiet").stdout == ""


def test_the_figures_are_those_of_the_python_tools(record: Record, tmp_path: Path) -> None:
    path, out = record(drive()), tmp_path / "out.plr"
    summary = run(path, "--json", "--out", out).summary
    poses = poses_of(out)
    estimate = Poses(np.array([p.R_WB for p in poses]), np.array([p.p_WB_m for p in poses]))
    rotations, positions = zip(*(true_pose(k) for k in range(FRAMES)), strict=True)
    figures = reference.figures(estimate, Poses(np.array(rotations), np.array(positions)))
    assert summary["err0_m"] == pytest.approx(figures.err0_m, rel=1e-6)
    assert summary["ate_m"] == pytest.approx(figures.ate_m, rel=1e-6)
    assert summary["rot_deg"] == pytest.approx(figures.rot_deg, rel=1e-4)
    assert summary["path_m"] == pytest.approx(figures.path_m, rel=1e-6)


def test_without_truth_the_figures_are_null(record: Record) -> None:
    summary = run(record([m for m in drive() if m.kind != Kind.TRUTH]), "--json").summary
    assert all(summary[key] is None for key in ("err0_m", "ate_m", "rot_deg", "nees_per_dof"))
    assert summary["truth_frames"] == 0


def test_trajectory_frames_and_map_agree_with_the_log(record: Record, tmp_path: Path) -> None:
    tum, csv, ply, out = (tmp_path / name for name in ("a.tum", "a.csv", "a.ply", "a.plr"))
    options = ("--trajectory", tum, "--frames", csv, "--map", ply, "--out", out, "--slots", "12")
    assert run(record(drive()), *options, "--quiet").status == OK
    poses = poses_of(out)
    trajectory = np.loadtxt(tum)
    assert trajectory.shape == (FRAMES, 8)
    assert np.allclose(trajectory[:, 1:4], [p.p_WB_m for p in poses], atol=1e-6)
    assert np.allclose(np.linalg.norm(trajectory[:, 4:], axis=1), 1, atol=1e-6)
    assert tum.read_text().split()[0] == "5.000000000"

    rows = np.genfromtxt(csv, delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert len(rows) == FRAMES
    assert np.allclose(rows["var_theta_z"], [p.covariance[20] for p in poses], rtol=1e-6)
    assert (rows["trace"] > rows["var_rho_x"] + rows["var_rho_y"]).all()
    reports = [m for m in log_of(out) if isinstance(m, Report)]
    for column, field in (("used", "used"), ("new", "created"), ("nis_dof", "nis_dof")):
        assert rows[column].tolist() == [getattr(report, field) for report in reports]

    landmarks = [m for m in log_of(out) if isinstance(m, Landmark)]
    head, body = ply.read_text().split("end_header\n")
    assert f"element vertex {len(landmarks)}" in head
    table = np.loadtxt(io.StringIO(body))
    assert {int(role) for role in table[:, 4]} == {Role.EVICTED, Role.FINAL}
    near = [i for i, m in enumerate(landmarks) if np.sqrt(m.covariance[[0, 2, 5]]).max() < 0.2]
    assert len(near) > 5
    error = np.linalg.norm(table[near, :3] - points()[table[near, 3].astype(int)], axis=1)
    assert np.median(error) < 0.3


def test_a_log_replays_to_the_same_bits_with_its_own_settings(
    record: Record, tmp_path: Path
) -> None:
    first, second = tmp_path / "1.plr", tmp_path / "2.plr"
    options = ("--slots", "9", "--bias", "on", "--pixel-sigma", "0.7", "--twist-timing", "mid")
    assert run(record(drive()), "--out", first, *options, "--quiet").status == OK
    result = run(first, "--out", second, "--json")
    assert result.status == OK
    assert result.summary["slots"] == 9
    assert bits_of(first) == bits_of(second)
    assert [m.kind for m in log_of(first)] == [m.kind for m in log_of(second)]


@pytest.mark.parametrize("mode", ["slam", "dead_reckoning"])
def test_what_is_written_changes_no_bit(record: Record, tmp_path: Path, mode: str) -> None:
    path, plain, full = record(drive()), tmp_path / "1.plr", tmp_path / "2.plr"
    run(path, "--mode", mode, "--out", plain, "--quiet")
    others = ("--frames", tmp_path / "f", "--map", tmp_path / "m", "--trajectory", tmp_path / "t")
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
    assert result.status == OK
    assert result.summary["frames"] == FRAMES


# --- modes ----------------------------------------------------------------------------------------


def test_mapping_takes_the_truth_and_leaves_out_frames_without(record: Record) -> None:
    messages = [m for m in drive() if not (isinstance(m, Truth) and m.t_ns in (t_ns(7), t_ns(8)))]
    result = run(record(messages), "--mode", "mapping", "--json")
    summary = result.summary
    assert (summary["frames"], summary["without_truth"]) == (FRAMES - 2, 2)
    assert summary["err0_m"] < 1e-5
    assert summary["nees_per_dof"] is None
    assert "needs a TRUTH of equal time" in result.stderr


def known(sigma_m: float = 0.01) -> list[Message]:
    covariance = sigma_m**2 * np.array([1.0, 0, 1, 0, 0, 1])
    return [Landmark(i, p, covariance) for i, p in enumerate(points())]


def test_localization_beats_slam_and_dead_reckoning(record: Record) -> None:
    messages = drive(sigma_px=1.0)
    for i, m in enumerate(messages):
        if isinstance(m, Twist):
            noise = np.random.default_rng(i).normal(size=6)
            messages[i] = Twist(m.t_ns, m.v_B_mps + 0.3 * noise[:3], m.w_B_radps + 0.05 * noise[3:])
    path = record([messages[0], *known(), *messages[1:]])
    noise_options = ("--velocity-sigma", "0.3", "--gyro-sigma", "0.05", "--pixel-sigma", "1")
    error = {
        mode: run(path, "--mode", mode, *noise_options, "--json").summary["err0_m"]
        for mode in ("slam", "localization", "dead_reckoning")
    }
    assert error["localization"] < error["slam"] < error["dead_reckoning"]


def test_known_landmarks_are_for_localization_unless_slam_asks(record: Record) -> None:
    path = record([header(), *known(), *drive()[1:]])
    plain = run(path, "--json").summary
    asked = run(path, "--json", "--known-map", "on").summary
    assert plain["new"] > 0
    assert asked["err0_m"] < plain["err0_m"]


def test_start_can_be_chosen(record: Record, tmp_path: Path) -> None:
    rotation, position = true_pose(20)
    messages = [header(), Start(t_ns(0), rotation, position), *drive()[1:]]
    first = {}
    for choice in ("auto", "recorded", "truth", "identity"):
        out = tmp_path / f"{choice}.plr"
        assert run(record(messages), "--start", choice, "--out", out, "--quiet").status == OK
        first[choice] = poses_of(out)[0].p_WB_m
    assert np.allclose(first["auto"], position)
    assert np.allclose(first["recorded"], position)
    assert np.allclose(first["truth"], 0)
    assert np.allclose(first["identity"], 0)
    result = run(record(drive()), "--start", "recorded")
    assert result.status == RECORDING
    assert "--start asks for" in result.stderr


# --- settings -------------------------------------------------------------------------------------


def printed(*arguments: str | Path) -> dict[str, str]:
    result = run(*arguments, "--print-config")
    assert result.status == OK, result.stderr
    lines = (line.split("#")[0] for line in result.stdout.splitlines())
    pairs = (line.split("=") for line in lines)
    return {name.strip(): value.strip() for name, value in pairs}


def test_the_settings_are_those_of_the_format() -> None:
    assert list(printed()) == [setting.name for setting in settings.SETTINGS.values()]


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
    assert float(got["gate-residual"]) > 0
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
    ],
)
def test_options_without_sense_are_refused_by_name(
    record: Record, arguments: tuple[str, ...], words: str
) -> None:
    result = run(record(drive(2)), *arguments)
    assert result.status == USAGE
    assert words in result.stderr


def test_help_and_version_tell_all() -> None:
    shown = run("--help")
    assert shown.status == OK
    for setting in settings.SETTINGS.values():
        assert f"--{setting.name} " in shown.stdout
    for name in ("gate", "preset", "start", "config", "trajectory", "map", "frames", "out", "json"):
        assert f"--{name}" in shown.stdout
    assert "float64" in run("--version", program="pelorus-replay-f64").stdout


# --- files that are no recordings -----------------------------------------------------------------


def refused(path: Path, words: str, status: int = RECORDING) -> None:
    result = run(path, "--json")
    assert result.status == status
    assert str(path) in result.stderr
    assert words in result.stderr
    assert result.stdout == ""


def test_files_that_are_no_recordings_are_named_and_refused(record: Record, tmp_path: Path) -> None:
    refused(tmp_path / "absent.plr", "No such file")
    refused(tmp_path, "directory")
    refused(record(b""), "empty")
    refused(record(b"P6 640 480 255 " * 200), "not a Pelorus recording")
    refused(record(np.random.default_rng(1).bytes(3_000_000)), "not a Pelorus recording")
    refused(record(b"\0" * 5000), "not a Pelorus recording")
    future = replace(header(), version_major=2)
    refused(record([future, *drive()[1:]]), "version 2")
    refused(record(drive()[1:]), "no HEADER")
    refused(record([header()]), "no data")
    refused(record([header(), *(twist(k) for k in range(5))]), "no frame could be used")


@pytest.mark.parametrize(
    "camera",
    [
        replace(CAMERA, baseline_m=0),
        replace(CAMERA, baseline_m=-0.1),
        replace(CAMERA, fx_px=0),
        replace(CAMERA, cx_px=math.nan),
        replace(CAMERA, fy_px=math.inf),
    ],
)
def test_a_camera_without_sense_is_refused(record: Record, camera: Camera) -> None:
    refused(record([header(camera=camera), *drive()[1:]]), "HEADER: the calibration makes no sense")


def test_outputs_that_cannot_be_written_are_refused(record: Record, tmp_path: Path) -> None:
    path = record(drive())
    for option in ("--out", "--trajectory", "--frames", "--map"):
        result = run(path, option, tmp_path / "no" / "such" / "folder")
        assert result.status == OUTPUT
        assert "no/such/folder: cannot be written" in result.stderr
    before = path.read_bytes()
    assert run(path, "--out", path).status == OUTPUT
    assert path.read_bytes() == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is not here")
def test_a_full_disk_is_told(record: Record) -> None:
    for option in ("--out", "--trajectory", "--frames", "--map"):
        result = run(record(drive()), option, "/dev/full", "--quiet")
        assert result.status == OUTPUT
        assert "/dev/full: not wholly written" in result.stderr


# --- damage ---------------------------------------------------------------------------------------


def test_a_truncated_recording_is_used_up_to_the_cut(record: Record) -> None:
    whole = encode(drive())
    for share in (0.3, 0.5, 0.77, 0.99):
        cut = whole[: int(share * len(whole))]
        result = run(record(cut), "--json")
        assert result.status == OK
        assert "has no END" in result.stderr
        summary = result.summary
        assert summary["ended"] is False
        assert summary["cut_in_frame"] is not cut.endswith(b"\0")
        if summary["cut_in_frame"]:
            assert f"in the middle of a frame, at byte {len(cut)}" in result.stderr
        assert 0.5 * share * FRAMES < summary["frames"] <= FRAMES


def test_any_cut_of_a_short_recording_ends_in_a_message(record: Record) -> None:
    whole = encode(drive(2))
    for length in range(0, len(whole), 23):
        result = run(record(whole[:length]), "--json")
        assert result.status in (OK, RECORDING)
        assert result.stderr != ""


def test_damaged_bytes_cost_frames_which_are_counted_and_placed(
    record: Record, tmp_path: Path
) -> None:
    whole = encode(drive())
    chance = np.random.default_rng(3)
    first = whole.index(b"\0") + 1  # behind the HEADER
    for count in (1, 5, 20):
        damaged = bytearray(whole)
        for at in chance.choice(np.arange(first, len(whole)), count, replace=False):
            damaged[at] ^= 1 << int(chance.integers(8))
        out = tmp_path / "out.plr"
        result = run(record(bytes(damaged)), "--json", "--out", out)
        assert result.status == OK
        summary = result.summary
        assert 0 < summary["damaged"] <= 2 * count
        assert "damaged frame" in result.stderr
        assert "byte " in result.stderr
        assert summary["frames"] >= FRAMES - 2 * count
        assert assert_healthy(out) == summary["frames"]


def test_the_place_of_a_damaged_frame_is_its_first_byte(record: Record) -> None:
    frames = encode(drive()).split(b"\0")[:-1]
    at = sum(len(frame) + 1 for frame in frames[:10])
    frames[10] = frames[10][:-1] + bytes([frames[10][-1] ^ 1 or 2])
    result = run(record(b"\0".join(frames) + b"\0"), "--json")
    assert f"byte {at}: damaged frame" in result.stderr
    assert result.summary["damaged"] == 1
    assert result.summary["missing"] == 1


def test_unknown_kinds_and_short_payloads_are_skipped_and_counted(record: Record) -> None:
    class Unknown(Message):
        kind = 99  # type: ignore[assignment]

        def pack(self) -> bytes:
            return b"later"

    class Short(Unknown):
        kind = Kind.TWIST

    messages = drive()
    messages[10:10] = [Unknown(), Short(), Unknown()]
    stream = b"".join(wire.encode(message, i) for i, message in enumerate(messages))
    summary = run(record(stream), "--json").summary
    assert (summary["unknown"], summary["malformed"], summary["damaged"]) == (2, 1, 0)
    assert summary["frames"] == FRAMES


# --- numbers that make no sense -------------------------------------------------------------------


def poisoned(message: Message, at: int, value: float, form: str = "<d") -> Message:
    """The message with a number of its payload replaced."""
    payload = bytearray(message.pack())
    struct.pack_into(form, payload, at, value)

    class Poisoned(Message):
        kind = message.kind

        def pack(self) -> bytes:
            return bytes(payload)

    return Poisoned()


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
@pytest.mark.parametrize("timing", ["start", "end", "mid"])
@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_twists(
    record: Record, tmp_path: Path, value: float, timing: str, program: str
) -> None:
    messages, out = drive(), tmp_path / "out.plr"
    for field in range(6):
        k = 5 + 5 * field
        i = next(i for i, m in enumerate(messages) if isinstance(m, Twist) and m.t_ns == t_ns(k))
        messages[i] = poisoned(messages[i], 8 + 8 * field, value)
    options = ("--twist-timing", timing, "--json", "--out", out)
    result = run(record(messages), *options, program=program)
    assert result.status == OK
    assert result.summary["messages_refused"] == 6, result.stderr
    assert assert_healthy(out) == FRAMES
    assert result.summary["err0_m"] < 0.3


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38, -3e38, 1e20])
def test_strange_numbers_in_observations(
    record: Record, tmp_path: Path, value: float, program: str
) -> None:
    messages, out = drive(), tmp_path / "out.plr"
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            pixels = m.pixels.copy()
            for n in range(4):
                pixels[n, n] = value
            messages[i] = replace(m, pixels=pixels)
    result = run(record(messages), "--json", "--out", out, program=program)
    assert result.status == OK
    assert result.summary["refused_observations"] == 4 * FRAMES
    assert "4 left out (not finite, or beyond any image)" in result.stderr
    assert assert_healthy(out) == FRAMES
    assert result.summary["err0_m"] < 0.2


@pytest.mark.parametrize("mode", ["slam", "mapping"])
@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_truth(record: Record, tmp_path: Path, value: float, mode: str) -> None:
    out = tmp_path / "out.plr"
    for field in range(12):
        messages = drive(10)
        for k in (0, 4):
            i = 2 + 3 * k
            messages[i] = poisoned(messages[i], 8 + 8 * field, value)
        result = run(record(messages), "--mode", mode, "--json", "--out", out)
        assert result.status == OK
        poses = poses_of(out)
        assert all(np.isfinite(pose.p_WB_m).all() for pose in poses)
        assert all(np.isfinite(pose.covariance).all() for pose in poses)
        assert len(poses) == (10 if mode == "slam" else result.summary["frames"])


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_a_start(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    start = Start(t_ns(0), covariance=np.eye(6)[np.tril_indices(6)] * 1e-4)
    whole = replace(start, flags=type(start.flags)(3), bias_variance=np.full(6, 1e-4))
    offsets = [*range(8, 104, 8), *range(105, 369, 8)]
    for at in offsets:
        messages = [header(), poisoned(whole, at, value), *drive(6)[1:]]
        result = run(record(messages), "--bias", "on", "--json", "--out", out)
        assert result.status == OK, result.stderr
        assert assert_healthy(out) == 6
        assert result.summary["messages_refused"] == 1
        assert "START: refused" in result.stderr


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_a_header(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    for at in range(10, 202, 8):
        path = record([poisoned(header(), at, value), *drive(6)[1:]])
        result = run(path, "--json", "--out", out)
        assert result.status in (OK, RECORDING)
        if at < 146 and not math.isfinite(value):
            assert result.status == RECORDING
            assert "calibration" in result.stderr
        if at >= 146:  # a suggestion: left out
            assert result.status == OK
        if result.status == OK:
            assert_healthy(out)


def test_strange_settings_are_left_out_and_named(record: Record) -> None:
    for value in STRANGE:
        wanted = Config(dict.fromkeys(settings.SETTINGS, value) | {200: 1.0})
        result = run(record([header(), wanted, *drive(6)[1:]]), "--json")
        assert result.status == OK
        assert result.summary["messages_refused"] == len(settings.SETTINGS) + 1
        assert "CONFIG: pixel-sigma = " in result.stderr
        assert "setting 200 is not known" in result.stderr


@pytest.mark.parametrize("value", STRANGE)
def test_strange_numbers_in_known_landmarks(record: Record, tmp_path: Path, value: float) -> None:
    out = tmp_path / "out.plr"
    landmarks = known()
    for field in range(9):
        landmarks[field] = poisoned(landmarks[field], 18 + 8 * field, value)
    path = record([header(), *landmarks, *drive()[1:]])
    result = run(path, "--mode", "localization", "--json", "--out", out)
    assert result.status == OK
    assert assert_healthy(out) == FRAMES
    assert result.summary["err0_m"] < 0.2


# --- time -----------------------------------------------------------------------------------------


def test_time_that_repeats_or_goes_back_is_refused_and_the_rest_used(record: Record) -> None:
    messages = drive()
    messages[31:31] = [twist(9), twist(4), stereo(4)]
    result = run(record(messages), "--json")
    assert result.status == OK
    assert result.summary["frames"] == FRAMES
    assert result.summary["messages_refused"] == 3
    assert "time repeats or goes back" in result.stderr
    assert "older than the last twist" in result.stderr


@pytest.mark.parametrize("jump", [-3600, 3600, 10**9])
def test_one_damaged_time_stamp_costs_one_message(
    record: Record, tmp_path: Path, jump: int
) -> None:
    messages = [later(m, 5000) for m in drive()[1:]]
    messages[30] = later(messages[30], jump)
    assert isinstance(messages[30], Twist)
    out = tmp_path / "out.plr"
    summary = run(record([header(), *messages]), "--json", "--out", out).summary
    assert (summary["frames"], summary["reanchored"]) == (FRAMES, 0)
    assert summary["messages_refused"] == 1
    assert summary["err0_m"] < 0.2
    assert_healthy(out)


@pytest.mark.parametrize("jump", [-1000, -30, 30, 10**6])
def test_a_clock_that_jumps_is_followed(record: Record, tmp_path: Path, jump: int) -> None:
    shifted = [later(m, 2000) for m in drive()[1:]]
    half = len(shifted) // 2
    moved = [later(m, jump) for m in shifted[half:]]
    out = tmp_path / "out.plr"
    result = run(record([header(), *shifted[:half], *moved]), "--json", "--out", out)
    assert result.status == OK
    assert result.summary["reanchored"] == 1
    assert "the clock jumped" in result.stderr
    assert result.summary["frames"] >= FRAMES - 3
    assert assert_healthy(out) == result.summary["frames"]
    poses = poses_of(out)
    assert poses[-1].covariance[0] > 100 * poses[10].covariance[0]  # it does not know where it is
    assert poses[-1].reset_count == 1


def test_frames_of_a_late_camera_need_the_delay(record: Record) -> None:
    data: list[tuple[float, Message]] = []
    for k in range(4 * FRAMES):
        exact = t_ns(0) + k * SECOND // 40
        data.append((exact, replace(twist(0), t_ns=exact)))
    for k in range(FRAMES):
        data += [(t_ns(k) + 0.08 * SECOND, truth(k)), (t_ns(k) + 0.08 * SECOND, stereo(k))]
    data.sort(key=lambda entry: entry[0])
    path = record([header(), *(message for _, message in data)])
    blind = run(path, "--json", "--start", "identity")
    delayed = run(path, "--json", "--start", "identity", "--twist-delay", "0.1").summary
    assert blind.status == RECORDING
    assert "older than the last twist" in blind.stderr
    assert f"{FRAMES} STEREO, {FRAMES} refused" in blind.stderr
    assert delayed["frames"] == FRAMES
    assert delayed["err0_m"] < 0.05


# --- frames that make no sense --------------------------------------------------------------------


def test_doubled_ids_are_refused_in_all_their_copies(record: Record) -> None:
    messages = drive()
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            messages[i] = replace(m, ids=np.concatenate([m.ids[:1], m.ids[:-1]]))
    result = run(record(messages), "--json")
    assert result.status == OK
    assert result.summary["duplicates"] == 2 * FRAMES
    assert "an id that stands twice" in result.stderr


def test_more_observations_than_fit_are_refused_and_the_rest_used(record: Record) -> None:
    messages = drive()
    many = 4096
    crowd = Stereo(t_ns(FRAMES), np.arange(many, dtype=np.uint32), np.ones((many, 4), np.float32))
    result = run(record([*messages, crowd]), "--json")
    assert result.status == OK
    assert result.summary["too_long"] == 1
    assert result.summary["frames"] == FRAMES
    assert "longer than this build holds" in result.stderr


@pytest.mark.parametrize("disparity", [0.0, -5.0, 0.01])
def test_disparities_that_put_a_point_nowhere_make_no_landmark(
    record: Record, tmp_path: Path, disparity: float
) -> None:
    messages, out = drive(), tmp_path / "out.plr"
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            pixels = m.pixels.copy()
            pixels[:, 2] = pixels[:, 0] - disparity
            messages[i] = replace(m, pixels=pixels)
    result = run(record(messages), "--json", "--out", out)
    assert result.status == OK
    assert (result.summary["new"], result.summary["used"]) == (0, 0)
    assert result.summary["poor"] > FRAMES
    assert "not one observation was used" in result.stderr
    assert assert_healthy(out) == FRAMES


def test_landmarks_that_fall_behind_the_camera_break_nothing(
    record: Record, tmp_path: Path
) -> None:
    """The body turns on the spot, and goes on claiming to see what is behind it."""
    first, out = stereo(0), tmp_path / "out.plr"
    messages: list[Message] = [header()]
    for k in range(FRAMES):
        messages.append(Twist(t_ns(k), np.zeros(3), np.array([0, 0, 1.0])))
        messages.append(replace(first, t_ns=t_ns(k)))
    for model in ("body", "world"):
        result = run(record(messages), "--json", "--out", out, "--model", model)
        assert result.status == OK
        assert result.summary["gated"] > 0
        assert assert_healthy(out) == FRAMES


def test_empty_frames_are_frames(record: Record) -> None:
    empty = [
        replace(stereo(k), ids=np.empty(0, np.uint32), pixels=np.empty((0, 4), np.float32))
        for k in range(5)
    ]
    summary = run(record([header(), *empty]), "--json").summary
    assert (summary["frames"], summary["observations"]) == (5, 0)


def test_a_header_that_changes_in_mid_flight_is_refused(record: Record) -> None:
    messages = drive()
    changed = header(camera=replace(CAMERA, fx_px=321))
    messages[30:30] = [header(), changed]
    result = run(record(messages), "--json")
    assert result.summary["messages_refused"] == 1
    assert "a calibration cannot change in mid-flight" in result.stderr
    assert result.summary["frames"] == FRAMES


def test_an_end_that_counts_more_than_there_is_is_told(record: Record) -> None:
    frames = encode(drive()).split(b"\0")[:-1]
    del frames[10:13]
    result = run(record(b"\0".join(frames) + b"\0"), "--json")
    assert result.status == OK
    assert "39 of 40 TWIST, 39 of 40 STEREO, 39 of 40 TRUTH" in result.stderr
    assert result.summary["missing"] == 3


def test_what_stands_behind_end_is_not_read(record: Record) -> None:
    stream = encode(drive())
    result = run(record(stream + stream), "--json")
    assert result.summary["frames"] == FRAMES
    assert "goes on behind END" in result.stderr


def test_a_name_with_quotes_and_controls_is_still_json(record: Record) -> None:
    result = run(record([header(name='a "b" \\ \n\x01 \u00e9'), *drive()[1:]]), "--json")
    assert result.summary["name"] == 'a "b" \\ \n\x01 \u00e9'
    payload = bytearray(header(name="abc").pack())
    payload[-2] = 0xFF

    class Bad(Message):
        kind = Kind.HEADER

        def pack(self) -> bytes:
            return bytes(payload)

    result = run(record([Bad(), *drive()[1:]]), "--json")
    assert result.summary["name"] == "a\ufffdc"


def test_world_in_float32_is_warned_of(record: Record) -> None:
    path = record([*drive(), Text("the end")])
    assert "breaks down in float32" in run(path, "--model", "world").stderr
    wide = run(path, "--model", "world", program="pelorus-replay-f64")
    assert "breaks down" not in wide.stderr


def test_a_deadline_limits_the_observations_and_the_log_keeps_the_number(
    record: Record, tmp_path: Path
) -> None:
    first, second = tmp_path / "1.plr", tmp_path / "2.plr"
    result = run(record(drive()), "--deadline", "20", "--out", first, "--json")
    assert result.status == OK
    assert result.summary["left_out"] > 0
    budgets = [m.budget for m in log_of(first) if isinstance(m, Stereo)]
    assert all(0 < budget < 65535 for budget in budgets)
    assert run(first, "--out", second, "--quiet").status == OK
    assert bits_of(first) == bits_of(second)
