# SPDX-License-Identifier: MIT
"""What a full disk leaves behind: nothing half-written, and what stood there before."""

from __future__ import annotations

import resource
import signal
import subprocess
from pathlib import Path

import pytest
from replay_drive import BIN, OK, OUTPUT, Record, bits_of, drive, run

MOST_BYTES = 8192  # a file that grows beyond fails as on a full disk
YESTERDAY = b"the result of yesterday"


def short_of_room() -> None:
    """In the child: without the signal, write() says so."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MOST_BYTES, MOST_BYTES))


@pytest.mark.parametrize(
    ("name", "before"), [("log.plr", None), ("log.plr", YESTERDAY), ("link.plr", YESTERDAY)]
)
def test_a_replay_that_finds_the_disk_full_leaves_what_was_there(
    record: Record, tmp_path: Path, name: str, before: bytes | None
) -> None:
    program, folder = BIN / "pelorus-replay", tmp_path / "out"
    if not program.exists():
        pytest.skip(f"{program} is not built")
    folder.mkdir()
    log = folder / "log.plr"
    if before is not None:
        log.write_bytes(before)
        (folder / "link.plr").symlink_to(log.name)
    there = sorted(folder.iterdir())
    done = subprocess.run(
        [str(program), str(record(drive())), "--out", str(folder / name), "--force"],
        capture_output=True,
        check=False,
        preexec_fn=short_of_room,
    )
    assert done.returncode == OUTPUT
    assert b"not wholly written" in done.stderr
    assert b"give --out LOG.plr" in done.stdout  # not the log that is not there
    assert name.encode() not in done.stdout
    assert sorted(folder.iterdir()) == there
    if before is not None:
        assert log.read_bytes() == before


def test_a_replay_writes_through_a_link_and_onto_standard_output(
    record: Record, tmp_path: Path
) -> None:
    program, source = BIN / "pelorus-replay", record(drive())
    log, link, piped = (tmp_path / name for name in ("log.plr", "link.plr", "piped.plr"))
    log.write_bytes(b"old")
    link.symlink_to(log.name)
    run(source, "--out", link, "--quiet")
    assert link.is_symlink()
    with piped.open("wb") as stream:
        command = [str(program), str(source), "--out", "/dev/stdout", "--quiet"]
        subprocess.run(command, stdout=stream, check=True)
        assert piped.stat().st_ino == Path(f"/dev/fd/{stream.fileno()}").stat().st_ino
    assert bits_of(piped) == bits_of(log)
    assert not list(tmp_path.glob("*.part"))


def test_a_recording_that_is_refused_leaves_an_earlier_result_alone(
    record: Record, tmp_path: Path
) -> None:
    log = tmp_path / "log.plr"
    log.write_bytes(YESTERDAY)
    refused = run(record(b"P6 640 480 255 " * 200), "--out", log, status=None)
    assert refused.status != OK
    assert log.read_bytes() == YESTERDAY
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("option", ["--out", "--trajectory"])
@pytest.mark.parametrize("name", ["result", "link"])
def test_a_result_that_is_there_is_kept_unless_it_is_forced(
    record: Record, tmp_path: Path, option: str, name: str
) -> None:
    kept = tmp_path / "result"
    kept.write_bytes(YESTERDAY)
    (tmp_path / "link").symlink_to(kept.name)
    source = record(drive())
    refused = run(source, option, tmp_path / name, status=OUTPUT, force=False)
    assert f"{tmp_path / name}: is there already; --force overwrites it" in refused.stderr
    assert kept.read_bytes() == YESTERDAY
    assert not list(tmp_path.glob("*.part"))
    run(source, option, tmp_path / name, "--quiet")
    assert kept.read_bytes() != YESTERDAY
    assert (tmp_path / "link").is_symlink()
