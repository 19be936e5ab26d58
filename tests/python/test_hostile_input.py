# SPDX-License-Identifier: MIT
"""Files and words that no honest user gives: a message and a status, never a traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
from converted import Run
from drives import clean
from pelorus.commands.choices import settings_given
from pelorus.errors import TEXT_BYTES_MAX, PelorusError, read_text, resolved


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("process = foo", "twist, imu are possible"),
        ("process = twist,imu", "twist, imu are possible"),
        ("mode = Slam", "slam"),
        ("calibrate = focal,colour", "some of them between commas, or off"),
    ],
)
def test_a_word_that_a_setting_does_not_have_is_refused(
    tmp_path: Path, pelorus: Run, words: str, told: str
) -> None:
    config, drive = tmp_path / "x.conf", tmp_path / "d.plr"
    config.write_text(words + "\n")
    clean(duration_s=1.0).write(drive)
    said = pelorus("check", drive, "--config", config, "--out", tmp_path / "t.conf", status=1).err
    assert words in " ".join(said.split())
    assert told in " ".join(said.split())
    name, value = words.split(" = ")
    with pytest.raises(PelorusError, match="are possible"):
        settings_given(None, [f"{name}={value}"])


def test_settings_that_are_right_pass(tmp_path: Path) -> None:
    config = tmp_path / "x.conf"
    config.write_text("process = imu\r\ncalibrate = off\npixel-sigma = 2 # px\n")
    given = settings_given(config, ["calibrate=focal,clock"])
    assert given == {"process": "imu", "calibrate": "focal,clock", "pixel-sigma": "2"}


def test_links_that_lead_back_to_themselves_are_told(tmp_path: Path, pelorus: Run) -> None:
    one, other = tmp_path / "one.plr", tmp_path / "other.plr"
    one.symlink_to(other)
    other.symlink_to(one)
    with pytest.raises(PelorusError, match="is a link that leads back to itself"):
        resolved(one)
    pelorus("simulate", one, "--duration", "1", status=1)
    for command in (("info", one), ("check", one), ("convert", "euroc", one, tmp_path / "o.plr")):
        pelorus(*command, status=1)


def test_a_file_without_an_end_is_read_no_further_than_settings_go(tmp_path: Path) -> None:
    with pytest.raises(PelorusError, match=f"too long: at most {TEXT_BYTES_MAX} bytes"):
        read_text(Path("/dev/zero"))
    path = tmp_path / "x.conf"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(PelorusError, match="is no text in UTF-8"):
        read_text(path)
