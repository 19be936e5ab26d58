# SPDX-License-Identifier: MIT
"""A release says which firmware nobody has tried."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from pelorus.robot.emulator import MACHINES

ROOT = Path(__file__).resolve().parents[2]
BOARDS = sorted(path.name for path in (ROOT / "port/cortex_m/boards").iterdir() if path.is_dir())


def test_files_of_boards_that_no_emulator_has_say_untried(tmp_path: Path) -> None:
    images, out = tmp_path / "images", tmp_path / "out"
    images.mkdir()
    out.mkdir()
    for board in BOARDS:
        for end in ("elf", "bin", "hex"):
            (images / f"pelorus-{board}-n32.{end}").write_text(board)
    words = f"set -eu; . tools/setup.sh; . tools/firmware/files.sh; ROBOT='{tmp_path}'"
    command = ["bash", "-c", f"{words}; copy_images '{out}' 1.2.3 {' '.join(BOARDS)}"]
    subprocess.run(command, check=True, cwd=ROOT)
    text = (out / "FIRMWARE.txt").read_text()
    found = {path.name for path in out.iterdir()} - {"FIRMWARE.txt"}
    assert len(found) == 3 * len(BOARDS)
    for board in BOARDS:
        tried = board in MACHINES
        name = f"pelorus-1.2.3-{board}-n32{'' if tried else '-untried'}"
        assert {f"{name}.{end}" for end in ("elf", "bin", "hex")} <= found
        assert re.search(rf"^{name}: {'emulated' if tried else 'UNTRIED'}", text, re.MULTILINE)


def test_release_names_its_images_so() -> None:
    script = (ROOT / "tools/release.sh").read_text()
    assert "copy_images" in script
    assert "images/" not in script
