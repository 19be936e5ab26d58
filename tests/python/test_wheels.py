# SPDX-License-Identifier: MIT
"""The wheel for Windows, made here: what is in it, and that its library answers (under Wine)."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import zipfile
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import pytest
from draws import long_run
from pelorus import __version__
from pelorus.native import binding
from PIL import Image

pytest.importorskip("ziglang")
pytest.importorskip("wheel")
pytest.importorskip("scikit_build_core")

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
import wheels

pytestmark = long_run  # zig builds the library for another system
NATIVE = ("pelorus-filter.dll", "pelorus-filter-f64.dll")
PROGRAMS = ("pelorus-replay.exe", "pelorus-replay-f64.exe")
# Loads a library, looks for each name that follows, and says its version.
LOADER = """
#include <stdio.h>
#include <windows.h>
int main(int count, char **words) {
    HMODULE library = LoadLibraryA(words[1]);
    if (!library)
        return 2;
    for (int i = 2; i < count; i++)
        if (!GetProcAddress(library, words[i]))
            return printf("lacks %s\\n", words[i]), 3;
    const char *(*lacks)(void) = (void *)GetProcAddress(library, "plr_binding_processor_lacks");
    const char *(*version)(void) = (void *)GetProcAddress(library, "plr_version");
    return printf("%s\\n", lacks() ? lacks() : version()), 0;
}
"""


def run(*command: str | Path, **variables: str) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        capture_output=True, text=True, check=False, env=os.environ | variables,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}:\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(own_wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compiled quickly: what it computes is for tools/cross.py."""
    folder = tmp_path_factory.mktemp("wheels")
    target = replace(wheels.WHEELS["win_amd64"], level=1)
    return wheels.make("win_amd64", target, own_wheel, folder, folder)


@pytest.fixture(scope="module")
def unpacked(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unpacked")
    run(sys.executable, "-m", "wheel", "unpack", wheel, "--dest", folder)  # checks all hashes
    return next(folder.iterdir())


def names() -> list[str]:
    """What Python looks for in the library."""
    fixed = [f"plr_filter_{name}" for name in binding.SIGNATURES]
    return [*fixed, *(name for name, _, _ in binding.OTHER_SIGNATURES)]


def test_the_wheel_is_of_windows_and_of_no_python(wheel: Path, unpacked: Path) -> None:
    assert wheel.name.endswith("-py3-none-win_amd64.whl")
    (about,) = unpacked.glob("*.dist-info/WHEEL")
    tags = [line for line in about.read_text().splitlines() if line.startswith("Tag: ")]
    assert tags == ["Tag: py3-none-win_amd64"]
    found = {path.name for path in (unpacked / "pelorus/native").iterdir()}
    assert found == {*NATIVE, *PROGRAMS}
    for name in found:
        assert (unpacked / "pelorus/native" / name).read_bytes()[:2] == b"MZ"
    inside = zipfile.ZipFile(wheel).namelist()
    assert "pelorus/commands/cli.py" in inside
    assert not [name for name in inside if name.endswith(".so")]


def test_the_wheels_readme_has_its_picture_and_no_link_that_leads_nowhere(unpacked: Path) -> None:
    (metadata,) = unpacked.glob("*.dist-info/METADATA")
    head, _, readme = metadata.read_text("utf-8").partition("\n\n")
    assert "\nName: pelorus-slam\n" in head
    assert "\nAuthor: Pelorus developers\n" in head
    pictures = re.findall(r"!\[[^]]+\]\(data:image/webp;base64,([^)]+)\)", readme)
    assert len(pictures) == 1
    assert Image.open(io.BytesIO(b64decode(pictures[0]))).width == 800
    links = re.findall(r"\]\(([^)]+)\)", readme)
    assert len(links) > 4
    assert [link for link in links if not link.startswith(("https://", "data:image/"))] == []


@pytest.mark.skipif(not shutil.which("objdump"), reason="no objdump")
@pytest.mark.parametrize("name", NATIVE)
def test_the_library_exports_what_python_calls(unpacked: Path, name: str) -> None:
    exported = set(run("objdump", "-p", unpacked / "pelorus/native" / name).split())
    wanted = names()
    assert len(wanted) > 30
    assert [one for one in wanted if one not in exported] == []


def test_the_library_answers_under_wine(unpacked: Path, tmp_path: Path) -> None:
    wine = shutil.which("wine64", path=f"{os.environ['PATH']}:/usr/lib/wine")
    if wine is None:
        pytest.skip("no wine64")
    source, loader = tmp_path / "loader.c", tmp_path / "loader.exe"
    source.write_text(LOADER)
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu")
    run(*zig, source, "-o", loader)
    home = {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}
    for name in NATIVE:
        library = unpacked / "pelorus/native" / name
        assert run(wine, loader, library, *names(), **home).strip() == __version__
    for name in PROGRAMS:
        said = run(wine, unpacked / "pelorus/native" / name, "--version", **home)
        assert __version__ in said
