# SPDX-License-Identifier: MIT
"""The page that replays in a browser, in headless Chromium: the sample, other recordings and
settings, and what it refuses.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from chromium import Tab, chromium, tab
from draws import long_run
from pelorus.commands.cli import main
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.skipif(chromium() is None, reason="no Chromium"),
    long_run,  # zig builds two programs of WebAssembly
]
PATIENCE_S = 120.0


class Page(Tab):
    """The page with the replay in it."""

    def shows(self, site: Path) -> None:
        self.call("Page.navigate", url=site.as_uri())
        self.until("document.readyState === 'complete' && !!document.getElementById('err')")

    def until(self, expression: str) -> Any:
        begun = time.monotonic()
        while not (found := self.does(expression)):
            assert time.monotonic() - begun < PATIENCE_S, f"never: {expression}"
            time.sleep(0.1)
        return found

    def text(self, id: str) -> str:
        return str(self.does(f"document.getElementById('{id}').textContent"))

    def drops(self, name: str, content: bytes) -> None:
        """A file is taken, as one that is dropped is."""
        packed = base64.b64encode(content).decode()
        self.does(
            f"takeFile(new File([Uint8Array.from(atob('{packed}'), "
            f"letter => letter.charCodeAt(0))], '{name}'))"
        )

    def replays(self, words: str = "") -> None:
        self.does("document.body.dataset.done = ''")
        self.does("document.getElementById('err').hidden = true")
        self.does(f"document.getElementById('more').value = {json.dumps(words)}")
        self.does("document.getElementById('run').click()")
        self.until("document.body.dataset.done === 'yes' || !document.getElementById('err').hidden")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("ziglang")
    folder = tmp_path_factory.mktemp("site")
    command = [
        sys.executable,
        str(ROOT / "tools/site.py"),
        "--only",
        "replay",
        "--out",
        str(folder),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "replay.html"


@pytest.fixture
def page(site: Path) -> Iterator[Page]:
    with tab(Page) as found:
        found.shows(site)
        yield found


def desk(recording: Path, *words: str) -> str:
    """The sum of the path that pelorus-replay makes of it."""
    path = recording.with_suffix(".tum")
    command = [str(BIN / "pelorus-replay"), str(recording), *words, "--trajectory", str(path)]
    subprocess.run(command, check=True, capture_output=True)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_the_sample_has_the_desks_sum(page: Page) -> None:
    page.does("document.getElementById('sample').click()")
    page.replays()
    assert page.text("err") == ""
    assert re.fullmatch("[0-9a-f]{64}", page.text("sum"))
    assert page.text("others") == f"a desk (x86-64 Linux): {page.text('sum')}: the same"
    assert "594 used" in page.text("out")
    took = re.match(r"([0-9.]+) s", page.text("state"))
    assert took
    assert float(took.group(1)) < 10  # 0.8 s alone; an unoptimised program takes 16


def test_the_boards_drive_has_the_sum_that_the_boards_gave(page: Page) -> None:
    """tests/target holds them to it."""
    page.does("document.getElementById('drive').click()")
    page.replays("--slots 32")
    golden = (ROOT / "tests/golden/drive.sha256").read_text().strip()
    assert page.text("sum") == golden
    assert re.search(f"a board .*: {golden}: the same", page.text("others"))
    page.replays("--slots 31")
    assert page.text("sum") != golden
    assert "the same" not in page.text("others").replace("with the same", "")


def test_another_recording_and_settings_have_theirs(page: Page, tmp_path: Path) -> None:
    recording = tmp_path / "other.plr"
    words = ("--seed", "8", "--duration", "10", "--imu-rate", "100")
    assert main(["simulate", *words, str(recording)]) == 0
    page.drops("other.plr", recording.read_bytes())
    page.replays("--slots 25 --pixel-sigma 1.3")
    assert page.text("err") == ""
    assert page.text("sum") == desk(recording, "--slots", "25", "--pixel-sigma", "1.3")
    assert page.text("others").startswith("A desk's, with the same")  # nothing is claimed of it


def test_what_cannot_be_replayed_is_said_and_no_sum_shown(page: Page, tmp_path: Path) -> None:
    recording = tmp_path / "cut.plr"
    assert main(["simulate", "--duration", "5", str(recording)]) == 0
    whole = recording.read_bytes()
    shown = "!document.getElementById('result').hidden"
    for name, content, words, said in (
        ("empty.plr", b"", "", "empty"),
        ("notes.plr", b"these are no frames at all " * 40, "", "is not a Pelorus recording"),
        ("drive.plr.zst", b"\x28\xb5\x2f\xfd" + bytes(60), "", "compressed by zstd"),
        ("good.plr", whole, "--pixel-sigma -4", "pixel-sigma"),
        ("good.plr", whole, "--slotz 4", "slotz"),
    ):
        page.does("document.getElementById('err').textContent = ''")
        page.drops(name, content)
        if not page.does("document.getElementById('run').disabled"):
            page.replays(words)
        assert said in page.text("err"), (name, words)
        assert not page.does(shown), name
    page.drops("cut.plr", whole[: len(whole) * 2 // 3])
    page.replays()
    assert page.does(
        shown
    )  # a recording that is cut is replayed as far as it goes, and that is said
    assert "cut" in page.text("out") or "END" in page.text("out")


def test_without_relaxed_simd_the_portable_program_gives_the_same(
    page: Page, tmp_path: Path
) -> None:
    recording = tmp_path / "short.plr"
    assert main(["simulate", "--seed", "9", "--duration", "3", str(recording)]) == 0
    worker = "document.getElementById('worker')"
    page.does(f"{worker}.textContent = {worker}.textContent.replace('return f(', 'return 0 * f(')")
    page.drops("short.plr", recording.read_bytes())
    page.replays("--slots 12")
    assert page.text("err") == ""
    assert "portable program ran" in page.text("state")
    assert page.text("sum") == desk(recording, "--slots", "12")
