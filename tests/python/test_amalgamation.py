# SPDX-License-Identifier: MIT
"""The two files of tools/amalgamate.py: they compile without a warning, as they are and with rooms
left out, refuse a processor that cannot, and compute the library's bits.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from draws import long_run
from pelorus.commands.cli import main
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
COMPILERS = [name for name in ("gcc", "clang-14") if shutil.which(name)]
WARNINGS = ("-Wall", "-Wextra", "-pedantic", "-Werror")
SIZES = (
    "-DPLR_MAX_LANDMARKS=256",
    "-DPLR_MAX_OBSERVATIONS=1024",
    "-DPLR_MAX_CALIBRATION=11",
)
NO_ROOM = ("-DPLR_MAX_CALIBRATION=0",)


@pytest.fixture(scope="module")
def two_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("amalgamation")
    command = [sys.executable, str(ROOT / "tools/amalgamate.py"), str(folder)]
    said = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "pelorus.h: " in said.stdout
    assert {path.name for path in folder.iterdir()} == {"pelorus.h", "pelorus.c"}
    return folder


def compiled(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [*words, "-c", "pelorus.c", "-o", "pelorus.o"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def names_in(folder: Path, *words: str) -> str:
    command = ["nm", *words, "pelorus.o"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(
    ("compiler", "options"),
    [
        (
            "gcc",
            ("-std=c99", "-DPLR_PORTABLE=1", "-DPLR_SUPERVISE=0", "-DPLR_KNOWN_MAP=0", *NO_ROOM),
        ),
        ("clang-14", ("-std=gnu11", "-DPLR_REAL=64", "-DPLR_MAX_LANDMARKS=8")),
        pytest.param("gcc", ("-std=c99", "-DPLR_PORTABLE=1", *SIZES), marks=long_run),
    ],
)
def test_they_compile_without_a_warning_and_need_no_library(
    two_files: Path, compiler: str, options: tuple[str, ...]
) -> None:
    if compiler not in COMPILERS:
        pytest.skip(f"no {compiler}")
    done = compiled(two_files, compiler, *options, "-O1", "-fno-math-errno", *WARNINGS)
    assert done.returncode == 0, done.stderr
    needed = names_in(two_files, "-u").split()
    assert {name for name in needed if name != "U"} <= {
        *("memcpy", "memset", "memmove", "memcmp", "bcmp", "strcmp", "strlen"),
        "_GLOBAL_OFFSET_TABLE_",
    }
    has_room = not set(NO_ROOM) <= set(options)
    if compiler == "gcc":  # estimates the calibration; clang makes it a part of its caller
        assert ("times_learnt" in names_in(two_files)) == has_room
    assert "plr_calibration_learn" in names_in(two_files)


@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
@pytest.mark.parametrize("compiler", COMPILERS)
def test_without_the_instruction_the_remedy_is_said(two_files: Path, compiler: str) -> None:
    if subprocess.run(["uname", "-m"], capture_output=True, check=True).stdout != b"x86_64\n":
        pytest.skip("every processor of this kind has the instruction")
    done = compiled(two_files, compiler, "-std=c99", "-O2")
    assert done.returncode != 0
    assert "needs fused multiply-add" in done.stderr
    assert "-march=x86-64-v3" in done.stderr
    assert "-DPLR_PORTABLE=1" in done.stderr


@pytest.mark.skipif("gcc" not in COMPILERS, reason="no gcc")
def test_the_bits_are_the_librarys_though_the_compiler_may_contract(two_files: Path) -> None:
    """-std=gnu11 lets gcc make one rounding of a product and a sum; the file forbids it."""
    sys.path.insert(0, str(ROOT / "tools"))
    import amalgamate  # noqa: PLC0415

    posix = (ROOT / "port/posix").glob("*.c")
    left_out = {"compressed_zstd.c", "system_windows.c", "pictures_none.c"}
    replay = amalgamate.program(ROOT, sorted(p for p in posix if p.name not in left_out))
    (two_files / "replay.c").write_text(replay, encoding="utf-8")
    native = subprocess.run(
        ["gcc", "-march=x86-64-v3", "-E", "-"],
        input="",
        capture_output=True,
        text=True,
        check=False,
    )
    arch = ["-march=x86-64-v3"] if native.returncode == 0 else []
    done = compiled(two_files, "gcc", "-std=gnu11", "-O2", *arch, *SIZES)
    assert done.returncode == 0, done.stderr
    names = ['-DPELORUS_NAME="replay"', '-DPELORUS_ARCH=""', "-D_XOPEN_SOURCE=700", *SIZES]
    link = ["gcc", "-std=c99", "-O1", *names, "replay.c", "pelorus.o", "-lm", "-o", "replay"]
    subprocess.run(link, cwd=two_files, check=True)
    drive = two_files / "drive.plr"
    assert main(["simulate", "--seed", "71", "--duration", "9", str(drive)]) == 0
    found = []
    for program in (BIN / "pelorus-replay", two_files / "replay"):
        path = two_files / "path.tum"
        command = [str(program), str(drive), "--slots", "30", "--quiet", "--force"]
        command += ["--trajectory", str(path)]
        subprocess.run(command, check=True, capture_output=True)
        found.append(path.read_bytes())
    assert len(found[0].splitlines()) > 80
    assert found[0] == found[1]
