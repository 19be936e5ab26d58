# SPDX-License-Identifier: MIT
"""The package as pip installs it: from its wheel alone, away from any checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from collections.abc import Iterable, Sequence
from importlib.metadata import distribution
from pathlib import Path

import pelorus
import pytest
from packaging.requirements import Requirement
from pelorus import __version__
from pelorus.commands.cli import main
from pelorus.program.distribution import mixed_up
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = ("cv2", "PIL", "matplotlib", "rosbags", "pyproj", "pyulog", "distributed", "duckdb")
MOST_BYTES = 250e6  # of a plain install


def without(packages: Sequence[str], *words: str) -> subprocess.CompletedProcess[str]:
    """A command where these are not installed."""
    hidden = f"import sys; sys.modules.update(dict.fromkeys({list(packages)}))"
    main = "from pelorus.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", f"{hidden}; {main}", *words]
    there = os.environ | {"PELORUS_BIN": str(BIN)}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=there)


def test_without_any_extra_a_sample_comes_to_its_report(tmp_path: Path) -> None:
    drive, out = str(tmp_path / "drive.plr"), tmp_path / "out"
    assert without(EXTRAS, "--help").returncode == 0
    assert without(EXTRAS, "simulate", "--duration", "4", drive).returncode == 0
    done = without(EXTRAS, "try", drive, "--out", str(out))
    assert (out / "report.html").is_file(), done.stderr
    assert "pip install 'pelorus-slam[figures]'" in done.stderr
    for words, files in (
        (("map", drive), {"map.pgm", "map.yaml"}),
        (("course", drive), {"table.md", "runs"}),
    ):
        folder = tmp_path / words[0]
        done = without(EXTRAS, *words, "--out", str(folder))
        assert done.returncode == 0, done.stderr
        assert "drawings (.png) need matplotlib, which is missing: pip install" in done.stderr
        assert {path.name for path in folder.iterdir()} == files


def test_somebody_elses_pelorus_beside_this_one_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert mixed_up() == ""
    for name, number in (("pelorus", "0.0.8"), ("pelorus_cli", "0.0.7")):
        (about := tmp_path / f"{name}-{number}.dist-info").mkdir()
        (about / "METADATA").write_text(f"Name: {name}\nVersion: {number}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    said = mixed_up()
    assert said.startswith("pip has installed pelorus 0.0.8 and pelorus-cli 0.0.7 here, too")
    assert "pip install --force-reinstall pelorus-slam" in said
    assert main(["--version"]) == 0
    warned = " ".join(capsys.readouterr().err.split())
    assert "warning: pip has installed pelorus 0.0.8 and" in warned
    monkeypatch.delattr(pelorus, "ARITHMETIC")  # as where that one was installed last
    assert main(["--version"]) == 1


def test_pip_puts_the_replay_on_the_path() -> None:
    for name, function in (("pelorus-replay", "float32"), ("pelorus-replay-f64", "float64")):
        program = f"from pelorus.native.replay_program import {function}"
        code = f"import sys; {program}; sys.exit({function}())"
        command = [sys.executable, "-c", code, "--version"]
        there = os.environ | {"PELORUS_BIN": str(BIN)}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=there)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"{name} {__version__}")
        nowhere = os.environ | {"PELORUS_BIN": os.devnull}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=nowhere)
        assert done.returncode == 1
        assert done.stderr.startswith(f"{name}: is in none of {os.devnull}: build it")


@pytest.mark.parametrize(
    ("extra", "code"),
    [
        ("vision", "from pelorus.program.extras import cv2; cv2.blur"),
        ("vision", "from pelorus.tracking.images import unpacked; unpacked(Path(), b'')"),
        ("ros", "from pelorus.converters.bag import Bag; Bag(Path('/dev/null'))"),
        (
            "px4",
            "from pelorus.program.extras import extra\nwith extra('pyulog'):\n    import pyulog",
        ),
        ("fleet", "from pelorus.fleet.table import require_database; require_database()"),
        ("fleet", "from pelorus.fleet.cluster import client_of; client_of(None, 1).__enter__()"),
        ("geodetic", "from pelorus.converters.geodetic import Ground; Ground().system()"),
    ],
)
def test_what_needs_an_extra_names_it(extra: str, code: str) -> None:
    hidden = f"import sys; sys.modules.update(dict.fromkeys({EXTRAS}))"
    done = subprocess.run(
        [sys.executable, "-c", f"{hidden}; from pathlib import Path; {code}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert f"which is missing: pip install 'pelorus-slam[{extra}]'" in done.stderr.splitlines()[-1]
    assert done.stderr.splitlines()[-1].startswith("pelorus.errors.PelorusError: ")


def installed_bytes(requirements: Iterable[str], seen: set[str]) -> int:
    """Returns the bytes of all files that these need, by this environment's versions."""
    total = 0
    for requirement in map(Requirement, requirements):
        wanted = requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        if wanted and requirement.name.lower() not in seen:
            seen.add(requirement.name.lower())
            found = distribution(requirement.name)
            paths = [Path(str(file.locate())) for file in found.files or ()]
            total += sum(path.stat().st_size for path in paths if path.exists())
            total += installed_bytes(found.requires or (), seen)
    return total


def test_a_plain_install_stays_small() -> None:
    """With OpenCV and the like as extras. Of what these tools take some 6 MB are their own."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    seen: set[str] = set()
    total = installed_bytes(project["dependencies"], seen)
    assert {"numpy", "scipy", "typer"} <= seen
    assert 150e6 < total < MOST_BYTES - 6e6


def test_every_command_works_from_the_wheel_alone(own_wheel: Path, tmp_path: Path) -> None:
    """In an environment of its own, which sees the dependencies of this one and no checkout."""
    assert "-py3-none-" in own_wheel.name  # of no version of Python
    packed = zipfile.ZipFile(own_wheel)
    assert not [name for name in packed.namelist() if "course" in name]  # tools/course is apart
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
    own = ("PELORUS", "PYTHON")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(own)}
    if prefix := sys.pycache_prefix:  # dependencies need not be compiled anew
        clean["PYTHONPYCACHEPREFIX"] = prefix

    def said(*words: str) -> str:
        done = subprocess.run(
            [environment / "bin/python", *words],
            capture_output=True, text=True, check=False, cwd=away, env=clean,
        )  # fmt: skip
        assert done.returncode == 0, f"{words}:\n{done.stdout}{done.stderr}"
        return done.stdout

    assert str(site) in said("-c", "import pelorus; print(pelorus.__file__)")
    for words in (
        "simulate d.plr --duration 3",
        "info d.plr",
        "check d.plr",
        "evaluate d.plr",
        "export d.plr --map m.ply",
        "report d.plr --out report",
        "map d.plr --out map",
    ):
        said("-m", "pelorus", *words.split())
    assert (away / "report/report.html").is_file()
    (entries,) = site.glob("pelorus_slam-*.dist-info/entry_points.txt")
    command = "pelorus-replay=pelorus.native.replay_program:float32"
    assert command in entries.read_text().replace(" ", "")
    said("-c", "from pelorus.native.replay_program import float32; float32()", "--version")
    camera = "pelorus.Calibration(400, 400, 320, 240, 0.1)"
    for precision in ("float32", "float64"):
        code = f"import pelorus; print(pelorus.Filter({camera}, precision={precision!r}).pose().p)"
        assert said("-c", code) == "[0. 0. 0.]\n"
