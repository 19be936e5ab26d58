# SPDX-License-Identifier: MIT
"""Files that somebody else wrote: whatever they hold, they are read or refused, in one way."""

from __future__ import annotations

import io
import os
import random
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pelorus
import pytest
from converted import SHORT, Run, messages_of
from drives import clean, mat_arrays, npz_arrays
from pelorus.errors import write_text
from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.wire.frames import NAME_BYTES_MAX, Header, header_name
from pelorus_course.mat import mat, read_mat
from scipy.io import loadmat, savemat

DAMAGES = 300


@pytest.fixture
def good_npz(tmp_path: Path) -> Path:
    path = tmp_path / "good.npz"
    np.savez_compressed(path, a=np.arange(50.0), b=np.ones((3, 3)))
    return path


@pytest.fixture
def good_mat(tmp_path: Path) -> Path:
    path = tmp_path / "good.mat"
    savemat(path, {"a": np.arange(50.0), "b": np.ones((3, 3)), "c": "words"})
    return path


def refused(path: Path, read: Callable[[Path], Any]) -> str:
    with pytest.raises(ForeignFileError) as caught:
        read(path)
    assert caught.value.path == path
    assert str(caught.value).startswith(f"{path}: ")
    return str(caught.value)


def assert_same_arrays(found: dict[str, Any], path: Path) -> None:
    due = {name: array for name, array in loadmat(path).items() if not name.startswith("__")}
    assert found.keys() == due.keys()
    for name, array in due.items():
        assert found[name].shape == array.shape
        assert np.array_equal(found[name], array)


# --- arrays ---------------------------------------------------------------------------------------


def encrypted(archive: bytes) -> bytes:
    """The same zip with the mark of a password on its first member."""
    out = bytearray(archive)
    out[out.find(b"PK\x03\x04") + 6] |= 1
    out[out.find(b"PK\x01\x02") + 8] |= 1
    return bytes(out)


def test_an_npz_that_is_none_is_refused_with_what_would_be_right(
    tmp_path: Path, good_npz: Path, pelorus: Run
) -> None:
    archive = good_npz.read_bytes()
    lone = io.BytesIO()
    np.save(lone, np.zeros(3))
    damaged = bytearray(archive)
    damaged[60] ^= 0xFF
    for name, content, said in (
        ("cut.npz", archive[:-30], "is no .npz file, or its end is missing; a .npz file"),
        ("lone.npy", lone.getvalue(), "is a lone array (.npy); a .npz file"),
        ("lone.npz", lone.getvalue(), "is a lone array (.npy); a .npz file"),
        (
            "locked.npz",
            encrypted(archive),
            "a.npy: is encrypted; a zip without a password is expected",
        ),
        ("damaged.npz", bytes(damaged), "cannot be read as .npz: "),
    ):
        path = tmp_path / name
        path.write_bytes(content)
        outcome = pelorus("convert", "ece276a", path, tmp_path / "out.plr", status=1)
        assert f"{path}: {said}" in outcome.err
        assert outcome.out == ""
    assert not list(tmp_path.glob("out.plr*"))


def test_an_archive_that_would_fill_the_memory_is_not_unpacked(
    tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign, "ARRAYS_BYTES_MAX", 1_000_000)
    zeros = np.zeros(1_000_000)
    np.savez_compressed(tmp_path / "bomb.npz", features=zeros)
    savemat(tmp_path / "bomb.mat", {"y_k_j": zeros}, do_compression=True)
    for name, form, said in (
        ("bomb.npz", "ece276a", r"holds 80\d* bytes of arrays; at most 1000000 are expected"),
        ("bomb.mat", "klt", r"more than 1000000 bytes, which are expected at most"),
    ):
        assert (tmp_path / name).stat().st_size < 100_000
        outcome = pelorus("convert", form, tmp_path / name, tmp_path / "out.plr", status=1)
        assert re.search(rf"{name}: .*{said}", outcome.err)


def test_the_limit_of_an_npz_is_that_of_all_its_arrays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign, "ARRAYS_BYTES_MAX", 1_000_000)
    path = tmp_path / "many.npz"
    np.savez_compressed(path, a=np.zeros(100_000), b=np.zeros(100_000))
    assert "bytes of arrays" in refused(path, foreign.npz)
    np.savez_compressed(path, a=np.zeros(100_000))
    assert foreign.npz(path)["a"].shape == (100_000,)


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "pickled.npz"
    np.savez(path, a=np.array([{"x": 1}], dtype=object))
    assert "cannot be read as .npz" in refused(path, foreign.npz)


@pytest.mark.parametrize("form", ["npz", "mat"])
def test_damage_anywhere_is_refused_or_read_and_never_something_else(
    tmp_path: Path, good_npz: Path, good_mat: Path, form: str
) -> None:
    source, read = (good_npz, foreign.npz) if form == "npz" else (good_mat, mat)
    chance, path, failed = random.Random(1), tmp_path / f"damaged.{form}", 0
    for _ in range(DAMAGES):
        content = bytearray(source.read_bytes())
        for _ in range(chance.randrange(1, 4)):
            content[chance.randrange(len(content))] = chance.randrange(256)
        path.write_bytes(content[: chance.randrange(1, 2 * len(content))])
        try:
            read(path)
        except ForeignFileError:
            failed += 1
    assert failed > DAMAGES // 4


def test_a_mat_file_is_read_as_scipy_reads_it(tmp_path: Path) -> None:
    written = {
        "double": np.linspace(-1, 1, 24).reshape(2, 3, 4),
        "whole": np.arange(-5, 300).reshape(5, 61),
        "large": np.array([[2**40, -(2**50)]]),
        "bytes": np.arange(200, dtype=np.uint8),
        "single": np.array([[1.5], [2.25]], np.float32),
        "s": 3.0,
        "none": np.zeros((3, 0)),
    }
    path = tmp_path / "x.mat"
    for packed in (False, True):
        savemat(path, written, do_compression=packed)
        assert_same_arrays(mat(path), path)


@pytest.mark.parametrize(
    "name", ["klt/2011_09_26_drive_0001_sync_KLT.mat", "starry-night/dataset3.mat"]
)
def test_a_real_mat_file_is_read_as_scipy_reads_it(real: Callable[[str], Path], name: str) -> None:
    assert_same_arrays(mat(real(name)), real(name))


def test_what_holds_no_numbers_is_told_as_such(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"t": "words", "u": {"a": 1}, "v": 1j * np.ones(3)})
    found = read_mat(path)
    for name in "tuv":
        with pytest.raises(ForeignFileError, match=f"{name} holds no numbers"):
            found.get(name)


def test_another_version_of_mat_is_told(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"a": np.ones((20, 20))}, format="4")
    assert "not that of a MATLAB file of version 5 to 7" in refused(path, mat)
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + bytes(384) + b"\x89HDF\r\n")
    assert "save it with -v7" in refused(path, mat)


@pytest.mark.parametrize("read", [foreign.npz, mat])
def test_a_folder_and_nothing_at_all_are_no_arrays(
    tmp_path: Path, read: Callable[[Path], Any]
) -> None:
    assert "is a folder" in refused(tmp_path, read)
    assert "no such file" in refused(tmp_path / "absent", read)
    (tmp_path / "empty").write_bytes(b"")
    assert "empty" in refused(tmp_path / "empty", read)


def test_variances_that_are_none_are_refused(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    arrays = mat_arrays(drive) | {"rho_i_pj_i": np.zeros((3, int(drive.tracks.id.max()) + 1))}
    source = tmp_path / "starry.mat"
    savemat(source, arrays | {"y_var": -1.0, "v_var": 1.0, "w_var": 1.0})
    outcome = pelorus("convert", "starry-night", source, tmp_path / "out.plr", status=1)
    assert "y_var is [-1.]; variances that are not negative are expected" in outcome.err


# --- text -----------------------------------------------------------------------------------------


def test_a_text_beyond_the_limit_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "long.txt"
    path.write_text("0123456789")
    assert foreign.text(path, 10) == "0123456789"
    assert "at most 9 bytes" in refused(path, lambda p: foreign.text(p, 9))
    endless = Path("/dev/zero")
    if endless.exists():
        assert "is too long" in refused(endless, lambda p: foreign.text(p, 1 << 22))


def test_a_byte_that_is_no_text_is_told_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "latin.csv"
    path.write_bytes("t_s,größe\n".encode("latin-1"))
    said = refused(path, foreign.csv_rows)
    assert said == f"{path}: byte 6: is no text; text in UTF-8 is expected"


def test_a_pipe_is_a_text_too(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=("1 2 3\n# rest\n4 5 6\n",))
    writer.start()
    assert foreign.rows(path) == [(1, ["1", "2", "3"]), (3, ["4", "5", "6"])]
    writer.join()


def test_a_calibration_as_large_as_a_recording_is_none(tmp_path: Path) -> None:
    path = tmp_path / "large.json"
    path.write_text(" " * foreign.JSON_BYTES_MAX + "{}")
    assert "is too long" in refused(path, foreign.json_object)


def test_the_place_of_a_mistake_in_json_is_told(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('{"a": 1,\n "b": }')
    assert f"{path}: line 2, column 7: " in refused(path, foreign.json_object)


# --- names ----------------------------------------------------------------------------------------


def test_a_file_whose_name_is_no_text_is_converted_and_said_visibly(
    tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**SHORT)
    source, target = tmp_path / "dri\udcffve.npz", tmp_path / "out\udcff.plr"
    np.savez_compressed(source, **npz_arrays(drive))
    outcome = pelorus("convert", "ece276a", source, target)
    assert r"out\udcff.plr: " in outcome.out
    assert messages_of(target, Header)[0].name == "dri?ve"
    assert r"out\udcff.plr" in pelorus("info", target).out
    write_text(tmp_path / "tuned.conf", f"# found in {target.name}\n")
    assert (tmp_path / "tuned.conf").read_text() == "# found in out\\udcff.plr\n"
    assert r"x\udcff: cannot be read" in pelorus("info", tmp_path / "x\udcff", status=1).err


def test_a_long_name_is_cut_between_characters() -> None:
    assert header_name("é" * 100) == "é" * (NAME_BYTES_MAX // 2)
    assert header_name("x" * NAME_BYTES_MAX) == "x" * NAME_BYTES_MAX
    assert header_name("\ud800x") == "?x"


def test_a_recording_that_cannot_be_written_leaves_no_part(tmp_path: Path) -> None:
    recording = clean(**SHORT).with_header(name="\ud800")
    with pytest.raises(UnicodeEncodeError):
        recording.write(tmp_path / "out.plr")
    assert list(tmp_path.iterdir()) == []


# --- in one place ---------------------------------------------------------------------------------

OPENS = re.compile(
    r"\.open\(|(?<![\w.])open\(|\.read_(text|bytes)\(|np\.(load|loadtxt|genfromtxt|fromfile)\b|"
    r"AnyReader\(|loadmat|json\.load|csv\.(reader|DictReader)|zipfile"
)
# What they open is the project's own: recordings, settings, results of its replay, its build, its
# devices.
OWN = (
    *("check/contents.py", "errors.py", "wire/framing.py"),
    *("wire/packed_file.py", "report/page.py", "native/replay.py", "wire/schema.py"),
    *("robot/emulator.py", "robot/serial.py"),
    *("fleet/examine.py", "fleet/table.py"),
)


# Bags have a reader of their own, which few commands need; it fails in the same way.
BAGS = "converters/bag.py"
TRY = "commands/first_try.py"  # asks a .npz for its names, to choose the converter


def test_foreign_files_are_opened_in_one_place() -> None:
    package = Path(pelorus.__file__).parent
    opening = {
        str(path.relative_to(package))
        for path in package.rglob("*.py")
        if OPENS.search(path.read_text(encoding="utf-8"))
    }
    assert opening == {"io/foreign.py", BAGS, TRY, *OWN}
