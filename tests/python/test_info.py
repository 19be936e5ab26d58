# SPDX-License-Identifier: MIT
"""What `pelorus info` says of whole, damaged and useless recordings."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from drives import clean
from pelorus.evaluate.survey import Gap, survey
from pelorus.wire import framing
from pelorus.wire.frames import Camera, Config, Header, Kind, Landmark, Message, Stereo, Text, Twist
from pelorus.wire.framing import Writer
from pelorus.wire.settings import SETTINGS, describe

HEADER = Header(Camera(500, 500, 320, 240, 0.2), name="[bold]mine[/]")
ROOT = Path(__file__).resolve().parents[2]


def write(path: Path, messages: Sequence[Message], end: bool = True) -> Path:
    stream = io.BytesIO()
    writer = Writer(stream)
    for message in messages:
        writer.write(message)
    if end:
        writer.end()
    path.write_bytes(stream.getvalue())
    return path


def twists(*milliseconds: int) -> list[Message]:
    return [Twist(t * 1_000_000) for t in milliseconds]


def test_a_whole_recording_is_shown(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=6.0)
    drive.write(tmp_path / "drive.plr")
    outcome = pelorus("info", tmp_path / "drive.plr")
    text = " ".join(outcome.out.split())
    for said in (
        "body axes forward-left-up",
        "twist timing start",
        "640 x 480 px",
        "focal lengths 420, 420 px",
        "baseline 0.2 m",
        "suggests pixel_sigma_px 0.5",
        "TWIST 61",
        "STEREO 61",
        "STEREO 0.000 6.000 10.00 0",
        f"{len(drive.tracks)} observations",
        f"of {len(np.unique(drive.tracks.id))} ids",
        "no damage",
    ):
        assert said in text, said


def test_settings_texts_and_landmarks_are_shown_by_name(tmp_path: Path, pelorus: Run) -> None:
    config = Config({1: 1.0, 3: 0.0, 8: 2.5, 99: 7.0}, 0x1234ABCD, 256, 512, 8, 4)
    messages = [HEADER, config, Landmark(1), Landmark(2), Text("gyro [red]\nreplaced", 1)]
    path = write(tmp_path / "x.plr", [*messages, *twists(0, 10)])
    text = " ".join(pelorus("info", path).out.split())
    for said in (
        "name [bold]mine[/]",
        "CONFIG (in force)",
        "1234abcd",
        "model world",
        "bias off",
        "pixel-sigma 2.5 px",
        "setting 99 7",
        "LANDMARK 2 2 known",
        r"warning: gyro [red]\nreplaced",
    ):
        assert said in text, said


def test_settings_are_those_of_the_formats_page() -> None:
    page = (ROOT / "docs" / "REPLAY-FORMAT.md").read_text()
    rows = page.split("| id | name | unit | values |")[1].split("<!-- end -->")[0].splitlines()[2:]
    told = {}
    for row in rows:
        number, name, unit, values = (cell.strip() for cell in row.split("|")[1:5])
        words = tuple(part.split()[1] for part in values.split(", ") if part[:1].isdigit())
        told[int(number)] = (name, unit, words)
    assert set(told) == set(SETTINGS)
    for id, (name, unit, words) in told.items():
        assert SETTINGS[id].name == name
        assert unit.startswith(SETTINGS[id].unit)
        if SETTINGS[id].words:
            assert SETTINGS[id].words == tuple(word.split("(")[0] for word in words)
    assert describe(2, 3.0) == ("mode", "dead_reckoning")
    assert describe(2, 3.5) == ("mode", "3.5")
    assert describe(2, float("nan")) == ("mode", "nan")


def test_rates_gaps_and_steps_back_are_counted(tmp_path: Path, pelorus: Run) -> None:
    path = write(tmp_path / "x.plr", [HEADER, *twists(0, 10, 20, 55, 65, 60, 70, 80)])
    stream = survey(path).streams[Kind.TWIST]
    assert stream.count == 8
    assert stream.rate_hz == pytest.approx(100)
    assert stream.gaps == [Gap(20_000_000, 35_000_000)]
    assert stream.steps_back == 1
    outcome = pelorus("info", path)
    assert "gap: TWIST pauses for 0.035 s after 0.020 s" in outcome.out
    assert "TWIST: time does not ascend 1 times" in outcome.out


def test_a_huge_file_that_is_no_recording_is_given_up_early(tmp_path: Path, pelorus: Run) -> None:
    path = tmp_path / "disk.img"
    with path.open("wb") as image:
        image.truncate(1 << 40)  # of holes: it takes no room, and hours to read
    outcome = pelorus("info", path, status=1)
    assert "holds no frame in its first 1114112 bytes; this is no .plr recording" in outcome.err


def test_damage_is_told_by_byte_and_the_rest_is_used(tmp_path: Path, pelorus: Run) -> None:
    path = write(tmp_path / "x.plr", [HEADER, *twists(*range(0, 100, 10))])
    data = bytearray(path.read_bytes())
    ends = [k for k, byte in enumerate(data) if byte == 0]
    data[ends[3] + 20] ^= 0xFF
    path.write_bytes(bytes(data))
    outcome = pelorus("info", path)
    assert "1 frames damaged, 1 missing in the sequence" in outcome.out
    assert f"byte {ends[3] + 1}: damaged: " in outcome.out
    assert "END tells of 10 TWIST frames, 9 can be read" in outcome.out


def test_a_recording_that_was_cut_short_says_so(tmp_path: Path, pelorus: Run) -> None:
    path = write(tmp_path / "x.plr", [HEADER, *twists(0, 10)], end=False)
    assert "there is no END: the recording was cut short" in pelorus("info", path).out
    path.write_bytes(path.read_bytes()[:-5])
    outcome = pelorus("info", path)
    assert "cut off by the end of the stream" in outcome.out


@pytest.mark.parametrize(
    ("messages", "said"), [(twists(0, 10), "there is no HEADER"), ([HEADER], "there are no data")]
)
def test_a_recording_of_no_use_has_a_status_that_says_so(
    tmp_path: Path, pelorus: Run, messages: list[Message], said: str
) -> None:
    outcome = pelorus("info", write(tmp_path / "x.plr", messages), status=1)
    assert "x.plr" in outcome.err
    assert said in outcome.err


def test_what_is_no_recording_is_refused(tmp_path: Path, pelorus: Run) -> None:
    path = tmp_path / "x.plr"
    for content in (b"", b"hello", bytes(range(256)) * 100):
        path.write_bytes(content)
        outcome = pelorus("info", path, status=1)
        assert "x.plr" in outcome.err
    pelorus("info", tmp_path / "absent.plr", status=1)
    pelorus("info", tmp_path, status=1)
    write(path, [replace(HEADER, version_major=2), *twists(0, 10)])
    outcome = pelorus("info", path, status=1)
    assert "format version 2" in outcome.err


def test_observations_without_disparity_or_finite_pixels_are_counted(tmp_path: Path) -> None:
    pixels = np.array([[9, 5, 4, 5], [4, 5, 4, 5], [3, 5, 4, 5], [np.nan, 5, 4, 5]], np.float32)
    frame = Stereo(1, np.arange(4, dtype=np.uint32), pixels)
    empty = Stereo(2, np.empty(0, np.uint32), np.empty((0, 4), np.float32))
    found = survey(write(tmp_path / "x.plr", [HEADER, frame, empty])).tracks
    assert found is not None
    assert found.no_disparity == 3
    assert found.per_frame == (0, 2, 4)


def test_random_bytes_never_break_the_reader(tmp_path: Path, pelorus: Run) -> None:
    good = framing.encode(HEADER, 0) + b"".join(framing.encode(m, 1) for m in twists(0, 10))
    path = tmp_path / "x.plr"
    for seed in range(60):
        chance = np.random.default_rng(seed)
        data = np.frombuffer(good, np.uint8).copy()
        hit = chance.integers(0, len(data), 1 + seed // 4)
        data[hit] = chance.integers(0, 256, len(hit))
        path.write_bytes(data.tobytes()[: chance.integers(1, len(data))])
        assert pelorus("info", path, status=None).status in (0, 1)


def test_info_as_json_holds_what_is_shown(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=6.0)
    drive.write(tmp_path / "drive.plr")
    said = pelorus("info", tmp_path / "drive.plr", "--json")
    found = json.loads(said.out)
    assert found["frames"]["STEREO"] == found["streams"]["STEREO"]["count"] == 61
    assert found["streams"]["STEREO"]["rate_hz"] == pytest.approx(10)
    assert found["header"]["baseline_m"] == 0.2
    assert found["header"]["suggests"]["pixel_sigma_px"] == 0.5
    assert found["tracks"]["observations"] == len(drive.tracks)
    assert found["health"] is None  # no filter has answered
    assert found["damage"]["damaged"] == 0
    path = write(tmp_path / "x.plr", [replace(HEADER, camera=Camera(np.nan, 1, 1, 1, np.inf))])
    bare = pelorus("info", path, "--json", status=1)
    assert json.loads(bare.out)["header"]["fx_px"] is None
    assert json.loads(bare.out)["useful"] is False


def test_words_in_a_recording_do_not_command_the_terminal(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(duration_s=1.0).with_header(name="\x1b[31mred\x1b[0m")
    path = tmp_path / "esc.plr"
    replace(drive, remarks=[Text("\x1b]0;title\x07 done")]).write(path)
    said = pelorus("info", path)
    assert r"\x1b[31mred\x1b[0m" in said.out
    assert r"info: \x1b]0;title\x07 done" in said.out
    assert "\x1b" not in said.out
