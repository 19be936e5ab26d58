# SPDX-License-Identifier: MIT
"""Packed recordings (.plr.zst): every command reads and writes them by their name."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from fake_board import FakeBoard, TcpBoard
from pelorus.wire import framing, packed_file
from pelorus.wire.frames import Stereo
from replay_drive import BIN, FRAMES, drive, encode
from report_runs import built_programs


def packed(folder: Path, content: bytes, name: str = "drive.plr.zst") -> Path:
    path = folder / name
    with closing(packed_file.create(path, packed=True)) as stream:
        stream.write(content)
    return path


def test_a_packed_recording_is_read_as_the_plain_one(tmp_path: Path) -> None:
    content = encode(drive())
    plain = tmp_path / "drive.plr"
    plain.write_bytes(content)
    expected, counts = framing.read_file(plain)
    for name in ("drive.plr.zst", "misnamed.plr"):  # what it is, its bytes say
        received, found = framing.read_file(packed(tmp_path, content, name))
        assert received == expected
        assert found == counts


def test_two_packed_pieces_in_a_row_are_one_recording(tmp_path: Path) -> None:
    content = encode(drive())
    one, other = (packed(tmp_path, part).read_bytes() for part in (content[:3000], content[3000:]))
    path = tmp_path / "drive.plr.zst"
    path.write_bytes(one + other)
    assert framing.read_file(path)[1].ended


@pytest.mark.parametrize("cut", [0.3, 0.9])
def test_of_a_file_that_was_cut_short_what_is_there_is_read(tmp_path: Path, cut: float) -> None:
    path = tmp_path / "drive.plr.zst"
    with closing(packed_file.create(path, packed=True, live=True)) as stream:  # a killed recorder's
        for start in range(0, len(content := encode(drive(200))), 500):
            stream.write(content[start : start + 500])
            stream.flush()
    whole = path.read_bytes()
    path.write_bytes(whole[: int(cut * len(whole))])
    received, counts = framing.read_file(path)
    assert len(received) > 0.5 * cut * 600
    assert not counts.ended


def test_behind_damage_nothing_can_be_unpacked_and_that_is_told(
    pelorus: Run, tmp_path: Path
) -> None:
    content = encode(drive(200))
    path = tmp_path / "drive.plr.zst"
    with closing(packed_file.create(path, packed=True, live=True)) as stream:
        for start in range(0, len(content), 500):
            stream.write(content[start : start + 500])
            stream.flush()
    bytes_ = bytearray(path.read_bytes())
    bytes_[len(bytes_) // 2 : len(bytes_) // 2 + 40] = b"\xff" * 40
    path.write_bytes(bytes_)
    received, counts = framing.read_file(path)
    assert 0 < len(received) < 600
    assert counts.damaged >= 1
    assert "zstd packing is damaged" in pelorus("info", path).out
    path.write_bytes(packed_file.MAGIC + b"nonsense")
    said = pelorus("info", path, status=1)
    assert "damaged: the zstd packing is damaged here" in said.err


def test_a_killed_recorder_leaves_all_but_the_last_block(tmp_path: Path) -> None:
    path, content = tmp_path / "log.plr.zst", encode(drive(300))
    stream = packed_file.create(path, packed=True, live=True)
    for start in range(0, len(content), 500):
        stream.write(content[start : start + 500])
        stream.flush()
    left = b"".join(packed_file.pieces(path))  # never closed
    assert len(content) - len(left) <= packed_file.LIVE_BYTES + 500
    assert content.startswith(left)
    stream.close()
    assert b"".join(packed_file.pieces(path)) == content


def test_a_simulated_drive_is_packed_by_its_name(pelorus: Run, tmp_path: Path) -> None:
    plain, small = tmp_path / "drive.plr", tmp_path / "drive.plr.zst"
    options = ("--seed", 3, "--duration", 5)
    pelorus("simulate", plain, *options)
    pelorus("simulate", small, *options)
    assert small.stat().st_size < 0.9 * plain.stat().st_size
    assert b"".join(packed_file.pieces(small)) == plain.read_bytes()
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("command", ["info", "report", "map", "course", "evaluate"])
def test_a_command_takes_a_packed_recording(pelorus: Run, tmp_path: Path, command: str) -> None:
    """Though the replay may know no zstd."""
    built_programs()
    frames = 1 if command == "report" else FRAMES  # of one it draws one picture, of more many
    path, out = packed(tmp_path, encode(drive(frames))), tmp_path / "out"
    options: dict[str, tuple[object, ...]] = {"info": (), "evaluate": ("--bin", BIN)}
    pelorus(command, path, *options.get(command, ("--out", out, "--bin", BIN)))


def test_a_robots_log_is_packed_and_compared(pelorus: Run, tmp_path: Path) -> None:
    path, log = packed(tmp_path, encode(drive(12))), tmp_path / "flight.plr.zst"
    with TcpBoard(FakeBoard()) as board:
        pelorus("stream", path, "--to", board.target, "--record", log)
    assert log.read_bytes().startswith(packed_file.MAGIC)
    assert framing.read_file(log)[1].ended
    assert pelorus("compare", log, "--bin", BIN, status=None).status in (
        0,
        1,
    )  # the fake board's own bits


def test_0027_takes_no_more_than_15_bytes_an_observation(
    real: Callable[[str], Path], zst_0027: Path
) -> None:
    source, path = real("ece276a/0027.npz"), zst_0027
    frames = [r.message for r in framing.read_file(path)[0] if isinstance(r.message, Stereo)]
    observations = int(np.sum([len(frame.ids) for frame in frames]))
    assert observations == 75647
    assert path.stat().st_size <= 15 * observations < source.stat().st_size
