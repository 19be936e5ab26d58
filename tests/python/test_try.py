# SPDX-License-Identifier: MIT
"""`pelorus try`: what a sample is, is seen by what is in it; one command leads to the report."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pelorus.commands.cli import main


@pytest.fixture(scope="module")
def tried(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a try, beside the recording."""
    folder = tmp_path_factory.mktemp("try")
    drive = folder / "drive.plr"
    words = ["--seed", "21", "--duration", "8", "--pixel-sigma", "1.4"]
    assert main(["simulate", *words, str(drive)]) == 0
    assert main(["try", str(drive), "--out", str(folder / "out")]) == 0
    return folder


def test_a_recording_is_checked_and_reported(tried: Path) -> None:
    assert (tried / "out/report.html").is_file()
    assert "pixel-sigma" in (tried / "out/tuned.conf").read_text()
    assert not (tried / "out/drive.plr").exists()  # nothing was converted


def test_nothing_is_overwritten_unasked(tried: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = (tried / "out/tuned.conf").read_bytes()
    assert main(["try", str(tried / "drive.plr"), "--out", str(tried / "out")]) == 1
    assert "tuned.conf: is there already" in capfd.readouterr().err
    assert (tried / "out/tuned.conf").read_bytes() == before


def empty(folder: Path) -> Path:
    folder.mkdir()
    return folder


def notes(path: Path) -> Path:
    path.write_text("notes")
    return path


def numbers(path: Path) -> Path:
    np.savez(path, numbers=np.arange(3))
    return path


@pytest.mark.parametrize(
    ("make", "name", "words"),
    [
        (lambda path: path, "gone.plr", "is not there"),
        (empty, "pictures", "is nothing that is known by its looks: a recording"),
        (notes, "notes.txt", "pelorus convert has a command for each"),
        (numbers, "numbers.npz", "a .npz with an IMU"),
    ],
)
def test_what_it_does_not_know_it_says_and_leaves_nothing(
    make: Callable[[Path], Path],
    name: str,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    source = make(tmp_path / name)
    assert main(["try", str(source)]) == 1
    said = " ".join(capfd.readouterr().err.split())
    assert words in said
    assert [path for path in tmp_path.iterdir() if path != source] == []


def test_a_data_set_is_known_by_what_is_in_it(real: Callable[[str], Path], tmp_path: Path) -> None:
    from pelorus.commands.first_try import _format_of  # noqa: PLC0415

    assert _format_of(real("imu/tum_corridor1-60-seed0.npz")) == "imu-npz"
    assert _format_of(real("images/euroc-v101-start/truth.tum").parent) == "euroc"
    for name in ("drive.mcap", "drive.bag", "drive.db3"):
        assert _format_of(notes(tmp_path / name)) == "ros"
    assert _format_of(notes(tmp_path / "packed.plr.zst")) == ""
