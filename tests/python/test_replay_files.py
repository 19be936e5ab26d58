# SPDX-License-Identifier: MIT
"""pelorus-replay on files that are no recordings, and on damaged, disordered and odd ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.wire import framing
from pelorus.wire.frames import (
    Camera,
    Kind,
    Message,
    Report,
    Stereo,
    Text,
    Twist,
)
from replay_drive import (
    CAMERA,
    FRAMES,
    OK,
    OUTPUT,
    RECORDING,
    SECOND,
    USAGE,
    Record,
    assert_healthy,
    bits_of,
    drive,
    encode,
    err0_m,
    header,
    judged,
    later,
    log_of,
    poses_of,
    run,
    stereo,
    t_ns,
    truth,
    twist,
)

FROZEN_IMAGE = 1 << 16  # plr_reason


# --- files that are no recordings -----------------------------------------------------------------


def refused(path: Path, words: str, status: int = RECORDING) -> None:
    result = run(path, "--json", status=status)
    assert str(path) in result.stderr
    assert words in result.stderr
    assert result.stdout == ""


def test_files_that_are_no_recordings_are_named_and_refused(record: Record, tmp_path: Path) -> None:
    refused(tmp_path / "absent.plr", "No such file")
    refused(tmp_path, "directory")
    refused(record(b""), "empty")
    refused(record(b"P6 640 480 255 " * 200), "not a Pelorus recording")
    refused(record(b"PK 3 4 " * 200), "pelorus convert makes one")
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
    for option in ("--out", "--trajectory"):
        result = run(path, option, tmp_path / "no" / "such" / "folder", status=OUTPUT)
        assert "no/such/folder: cannot be written" in result.stderr
    before = path.read_bytes()
    run(path, "--out", path, status=OUTPUT)
    assert path.read_bytes() == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is not here")
def test_a_full_disk_is_told(record: Record) -> None:
    for option in ("--out", "--trajectory"):
        result = run(record(drive()), option, "/dev/full", "--quiet", status=OUTPUT)
        assert "/dev/full: not wholly written" in result.stderr


# --- damage ---------------------------------------------------------------------------------------


def test_a_truncated_recording_is_used_up_to_the_cut(record: Record) -> None:
    whole = encode(drive())
    for share in (0.3, 0.5, 0.77, 0.99):
        cut = whole[: int(share * len(whole))]
        result = run(record(cut), "--json")
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
        result = run(record(whole[:length]), "--json", status=None)
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
    stream = b"".join(framing.encode(message, i) for i, message in enumerate(messages))
    summary = run(record(stream), "--json").summary
    assert (summary["unknown"], summary["malformed"], summary["damaged"]) == (2, 1, 0)
    assert summary["frames"] == FRAMES


# --- time -----------------------------------------------------------------------------------------


def test_time_that_repeats_or_goes_back_is_refused_and_the_rest_used(record: Record) -> None:
    messages = drive()
    messages[31:31] = [twist(9), twist(4), stereo(4)]
    result = run(record(messages), "--json")
    assert result.summary["frames"] == FRAMES
    assert result.summary["messages_refused"] == 3
    assert "time repeats or goes back" in result.stderr
    assert "older than what was used before it" in result.stderr


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
    assert err0_m(out) < 0.2
    assert_healthy(out)


@pytest.mark.parametrize("jump", [-1000, -30, 30, 10**6])
def test_a_clock_that_jumps_is_followed(record: Record, tmp_path: Path, jump: int) -> None:
    shifted = [later(m, 2000) for m in drive()[1:]]
    half = len(shifted) // 2
    moved = [later(m, jump) for m in shifted[half:]]
    out = tmp_path / "out.plr"
    result = run(record([header(), *shifted[:half], *moved]), "--json", "--out", out)
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
    blind = run(path, "--json", "--start", "identity", status=None)
    delayed = judged(path, "--start", "identity", "--twist-delay", "0.1")
    assert blind.status == RECORDING
    assert "older than what was used before it" in blind.stderr
    assert f"{FRAMES} STEREO, {FRAMES} refused" in blind.stderr
    assert delayed["frames"] == FRAMES
    assert delayed["err0_m"] < 0.05


def test_settings_that_contradict_are_one_sentence_with_why(record: Record) -> None:
    said = run(record(drive()), "--track-drift", "1", "--model", "world", status=USAGE).stderr
    assert "make no sense together: track-drift: goes with model = body alone" in said
    assert len(said.splitlines()) == 1


# --- frames that make no sense --------------------------------------------------------------------


def test_doubled_ids_are_refused_in_all_their_copies(record: Record) -> None:
    messages = drive()
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            messages[i] = replace(m, ids=np.concatenate([m.ids[:1], m.ids[:-1]]))
    result = run(record(messages), "--json")
    assert result.summary["duplicates"] == 2 * FRAMES
    assert "an id that stands twice" in result.stderr


def test_more_observations_than_fit_are_refused_and_the_rest_used(record: Record) -> None:
    messages = drive()
    many = 4096
    crowd = Stereo(t_ns(FRAMES), np.arange(many, dtype=np.uint32), np.ones((many, 4), np.float32))
    result = run(record([*messages, crowd]), "--json")
    assert result.summary["too_long"] == 1
    assert result.summary["frames"] == FRAMES
    assert "longer than this build holds" in result.stderr


@pytest.mark.parametrize(
    ("disparity", "model"), [(0.0, "world"), (-5.0, "world"), (1e-4, "world"), (-10.0, "body")]
)
def test_disparities_that_put_a_point_nowhere_make_no_landmark(
    record: Record, tmp_path: Path, disparity: float, model: str
) -> None:
    """`body` takes a point beyond infinity if noise explains it; `world` has no place for one."""
    messages, out = drive(), tmp_path / "out.plr"
    for i, m in enumerate(messages):
        if isinstance(m, Stereo):
            pixels = m.pixels.copy()
            pixels[:, 2] = pixels[:, 0] - disparity
            messages[i] = replace(m, pixels=pixels)
    result = run(record(messages), "--json", "--out", out, "--model", model)
    assert (result.summary["new"], result.summary["used"]) == (0, 0)
    assert result.summary["poor"] > FRAMES
    assert "not one observation was used" in result.stderr
    assert assert_healthy(out) == FRAMES


def test_landmarks_that_fall_behind_the_camera_break_nothing(
    record: Record, tmp_path: Path
) -> None:
    """The body turns on the spot, and goes on claiming to see what is behind it.

    With two points: three that agree would be believed against the twists.
    """
    first, out = stereo(0), tmp_path / "out.plr"
    messages: list[Message] = [header()]
    for k in range(FRAMES):
        messages.append(Twist(t_ns(k), np.zeros(3), np.array([0, 0, 1.0])))
        moved = first.pixels + np.float32(
            0.25 * (k % 2)
        )  # or it would be taken for a frozen picture
        messages.append(replace(first, t_ns=t_ns(k), ids=first.ids[:2], pixels=moved[:2]))
    for model in ("body", "world"):
        result = run(record(messages), "--json", "--out", out, "--model", model)
        assert result.summary["gated"] > 0
        assert assert_healthy(out) == FRAMES


def test_a_picture_that_is_sent_again_while_the_body_turns_is_frozen(
    record: Record, tmp_path: Path
) -> None:
    first, out = stereo(0), tmp_path / "out.plr"
    messages: list[Message] = [header()]
    for k in range(FRAMES):
        messages.append(Twist(t_ns(k), np.zeros(3), np.array([0, 0, 1.0])))
        messages.append(replace(first, t_ns=t_ns(k)))
    result = run(record(messages), "--json", "--out", out)
    assert assert_healthy(out) == FRAMES
    frozen = [bool(m.reasons & FROZEN_IMAGE) for m in log_of(out) if isinstance(m, Report)]
    assert sum(frozen) > FRAMES - 5
    assert not frozen[0]
    assert result.summary["used"] < 3 * len(first.ids)


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
    payload[payload.index(b"abc") + 1] = 0xFF

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
    assert result.summary["left_out"] > 0
    budgets = [m.budget for m in log_of(first) if isinstance(m, Stereo)]
    assert all(0 < budget < 65535 for budget in budgets)
    run(first, "--out", second, "--quiet")
    assert bits_of(first) == bits_of(second)
