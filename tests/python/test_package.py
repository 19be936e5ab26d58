# SPDX-License-Identifier: MIT
"""The package as pip installs it: from its wheel alone, away from any checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOT_THERE = (
    "import sys; sys.modules['cv2'] = None;"
    "from pelorus.cli import main; sys.exit(main(sys.argv[1:]))"
)


def without_opencv(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", NOT_THERE, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_without_opencv_only_pictures_are_refused(tmp_path: Path) -> None:
    assert without_opencv("--help").returncode == 0
    drive = tmp_path / "drive.plr"
    assert without_opencv("simulate", "--duration", "4", str(drive)).returncode == 0
    assert without_opencv("info", str(drive)).returncode == 0
    needs = (
        "from pelorus.tracking.matching import *;"
        "import numpy as np;"
        "from pelorus.opencv import cv2; cv2.blur"
    )
    code = f"import sys; sys.modules['cv2'] = None; {needs}"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "PelorusError: pictures need OpenCV" in said.stderr
    assert "pip install 'pelorus[vision]'" in said.stderr


def built(folder: Path) -> Path:
    """The wheel of this checkout."""
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
    isolation = ["--no-build-isolation", "--wheel-dir", str(folder), str(ROOT)]
    done = subprocess.run([*command, *isolation], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("pelorus-*.whl")
    return wheel


def test_every_command_works_from_the_wheel_alone(tmp_path: Path) -> None:
    """In an environment of its own, which sees the dependencies of this one and no checkout."""
    pytest.importorskip("scikit_build_core")
    wheel = built(tmp_path)
    assert "-py3-none-" in wheel.name  # of no version of Python
    packed = zipfile.ZipFile(wheel)
    assert sum(info.file_size for info in packed.infolist()) < 10e6
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=False)
    (site,) = environment.glob("lib/python*/site-packages")
    packed.extractall(site)
    for native in (site / "pelorus/native").iterdir():
        native.chmod(0o755)  # which pip does
    numpy = Path(sys.modules["numpy"].__file__ or "").parents[1]
    (site / "dependencies.pth").write_text(f"{numpy}\n")
    away = tmp_path / "away"
    away.mkdir()
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PELORUS", "PYTHON"))}

    def said(*words: str) -> str:
        done = subprocess.run(
            [environment / "bin/python", *words],
            capture_output=True, text=True, check=False, cwd=away, env=clean,
        )  # fmt: skip
        assert done.returncode == 0, f"{words}:\n{done.stdout}{done.stderr}"
        return done.stdout

    assert str(site) in said("-c", "import pelorus; print(pelorus.__file__)")
    for words in (
        "simulate d.plr --duration 6",
        "info d.plr",
        "check d.plr",
        "evaluate d.plr",
        "export d.plr --map m.ply",
        "report d.plr --out report",
        "map d.plr --out map",
    ):
        said("-m", "pelorus", *words.split())
    assert (away / "report/report.html").is_file()
    camera = "pelorus.Calibration(400, 400, 320, 240, 0.1)"
    for precision in ("float32", "float64"):
        code = f"import pelorus; print(pelorus.Filter({camera}, precision={precision!r}).pose().p)"
        assert said("-c", code) == "[0. 0. 0.]\n"
