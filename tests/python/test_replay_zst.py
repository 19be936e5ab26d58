# SPDX-License-Identifier: MIT
"""Compressed recordings, `.plr.zst`, in the replay: by libzstd where the build has it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from pelorus.wire import packed_file
from replay_drive import BIN, OUTPUT, RECORDING, Record, bits_of, drive, run

ZSTD = shutil.which("zstd")
pytestmark = pytest.mark.skipif(ZSTD is None, reason="the program zstd is not here")


def zstd(*arguments: str | Path, stdin: bytes = b"") -> bytes:
    assert ZSTD is not None
    command = [ZSTD, "-q", *map(str, arguments)]
    return subprocess.run(command, check=True, input=stdin, capture_output=True).stdout


def reads_zst() -> bool:
    """Whether the build under test has libzstd."""
    shown = subprocess.run(["ldd", BIN / "pelorus-replay"], capture_output=True, check=False)
    return b"libzstd" in shown.stdout


with_library = pytest.mark.skipif(not reads_zst(), reason="the build has no libzstd")


def packed(path: Path) -> Path:
    out = path.with_suffix(".plr.zst")
    zstd("-19", "-f", path, "-o", out)
    return out


@with_library
def test_a_compressed_recording_gives_the_same_bits(record: Record, tmp_path: Path) -> None:
    path, plain, ours = record(drive()), tmp_path / "a.plr", tmp_path / "b.plr"
    run(path, "--out", plain)
    small = packed(path)
    assert small.stat().st_size < path.stat().st_size
    nameless = Path(shutil.copy(small, tmp_path / "no-such-name"))
    for source in (small, nameless):  # told by its bytes
        run(source, "--out", ours)
        assert bits_of(plain) == bits_of(ours)
    run("-", "--out", ours, stdin=small.read_bytes())
    assert bits_of(plain) == bits_of(ours)


@with_library
def test_a_log_named_zst_is_compressed_and_is_the_plain_one_within(
    record: Record, tmp_path: Path
) -> None:
    path, plain, small = record(drive()), tmp_path / "log.plr", tmp_path / "log.plr.zst"
    run(path, "--out", plain, "--deadline", "0")
    run(path, "--out", small)
    whole = tmp_path / "whole.plr"
    whole.write_bytes(zstd("-dc", small))
    assert bits_of(whole) == bits_of(plain)
    assert small.stat().st_size < 0.8 * plain.stat().st_size
    run(small)  # and it is a recording


@with_library
def test_pieces_one_after_another_are_one_recording(record: Record, tmp_path: Path) -> None:
    content = record(drive()).read_bytes()
    parts = zstd("-c", stdin=content[:5000]) + zstd("-c", stdin=content[5000:])
    path = tmp_path / "parts.plr.zst"
    path.write_bytes(parts)
    assert run(path, "--json").summary["frames"] == 40


@with_library
def test_one_that_was_cut_is_used_as_far_as_it_goes(record: Record, tmp_path: Path) -> None:
    content = packed(record(drive(300))).read_bytes()
    path = tmp_path / "cut.plr.zst"
    path.write_bytes(content[: len(content) - 30])
    result = run(path)
    assert "its compression ends early" in result.stderr


@with_library
def test_one_of_which_nothing_is_left_is_not_called_empty(record: Record, tmp_path: Path) -> None:
    path = tmp_path / "cut.plr.zst"
    path.write_bytes(packed(record(drive(300))).read_bytes()[:40])
    result = run(path, status=RECORDING)
    assert "cut off before its first bytes come out" in result.stderr


@with_library
def test_damage_is_told(record: Record, tmp_path: Path) -> None:
    content = bytearray(packed(record(drive(300))).read_bytes())
    content[4:9] = b"\xff" * 5
    path = tmp_path / "damaged.plr.zst"
    path.write_bytes(content)
    result = run(path, status=RECORDING)
    assert "its compression is damaged" in result.stderr


@pytest.mark.skipif(reads_zst(), reason="the build has libzstd")
def test_without_the_library_the_way_round_is_named(record: Record, tmp_path: Path) -> None:
    path = packed(record(drive(2)))
    result = run(path, status=RECORDING)
    assert "zstdcat FILE | pelorus-replay -" in result.stderr
    run("-", stdin=zstd("-dc", path))
    log = tmp_path / "out.plr.zst"
    refused = run(record(drive(3)), "--out", log, status=OUTPUT)
    assert "no libzstd" in refused.stderr
    assert not log.exists()


@with_library
def test_0027_takes_15_bytes_an_observation(zst_0027: Path, tmp_path: Path) -> None:
    """As the course's own file has it: without truth. That file takes 21.7."""
    path = tmp_path / "0027.plr"
    path.write_bytes(b"".join(packed_file.pieces(zst_0027)))
    small = packed(path)
    observations = run(small, "--mode", "dead_reckoning", "--json").summary["observations"]
    assert observations == 75647
    assert small.stat().st_size / observations <= 15
