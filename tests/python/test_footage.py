# SPDX-License-Identifier: MIT
"""Pictures on the page: which frames are shown, and that points, rejections and residuals are drawn
where the log has them.
"""

from __future__ import annotations

import io
import re
from base64 import b64decode
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from chromium import Tab, tab
from converted import Run as Command
from numpy.typing import NDArray
from pelorus.explain import explain
from pelorus.report.footage import MOMENTS_MOST, WIDTH_PX, footage
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Header, Message, Stereo
from pelorus.wire.framing import messages_of, write_file
from PIL import Image
from replay_drive import run

SLIPPED_S = 8.0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the log of a drive that slips."""
    folder = tmp_path_factory.mktemp("footage")
    mishaps = Mishaps(slip=0.5, slip_span=Span(SLIPPED_S, 3.0))
    recording = simulate(Options(seed=4, duration_s=14.0, mishaps=mishaps)).recording
    recording.write(folder / "in.plr")
    run(folder / "in.plr", "--quiet", "--out", folder / "log.plr")
    return folder / "log.plr"


def frames_of(log: Path) -> list[Stereo]:
    return [m for m in messages_of(log) if isinstance(m, Stereo)]


def size_of(log: Path) -> tuple[int, int]:
    header = next(m for m in messages_of(log) if isinstance(m, Header))
    return header.image_width_px, header.image_height_px


def black(folder: Path, names: list[str], size: tuple[int, int]) -> Path:
    """Pictures on which all that is bright is drawn."""
    folder.mkdir()
    for name in names:
        Image.new("L", size).save(folder / f"{name}.png")
    return folder


@pytest.fixture(scope="module")
def pictures(log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    names = [str(10**16 + frame.t_ns) for frame in frames_of(log)]
    return black(tmp_path_factory.mktemp("pictures") / "left", names, size_of(log))


@pytest.fixture(scope="module")
def dated(log: Path) -> Path:
    """The same log as of today's clock: names of pictures are such times."""
    path = log.with_name("dated.plr")
    shifted: list[Message] = []
    for m in messages_of(log):
        if hasattr(m, "t_ns"):
            object.__setattr__(m, "t_ns", m.t_ns + 10**16)
        shifted.append(m)
    write_file(path, shifted, len(shifted))
    return path


def unpacked(packed: bytes) -> NDArray[np.int64]:
    return np.asarray(Image.open(io.BytesIO(packed)).convert("RGB"), np.int64)


def test_points_are_drawn_where_the_log_has_them_and_rejected_ones_red(
    dated: Path, pictures: Path
) -> None:
    messages = messages_of(dated)
    shown = footage(messages, explain(messages), pictures)
    frames = {m.t_ns: m for m in messages if isinstance(m, Stereo)}
    rejected = {m.t_ns: set(m.rejected["id"].tolist()) for m in messages if isinstance(m, Evidence)}
    origin = min(frames)
    assert shown.frames == len(frames)
    assert 0 < len(shown.moments) <= MOMENTS_MOST
    reds = greens = 0
    for t_s, _, packed in shown.moments:
        image = unpacked(packed)
        t_ns = origin + round(t_s * 1e9)
        frame = frames[t_ns]
        scale = WIDTH_PX / size_of(dated)[0]
        at = np.round(frame.pixels[:, :2] * scale).astype(int)
        for id, (u, v) in zip(frame.ids.tolist(), at.tolist(), strict=True):
            if not (3 < u < image.shape[1] - 3 and 3 < v < image.shape[0] - 3):
                continue
            others = np.linalg.norm(at - (u, v), axis=1)
            if np.count_nonzero(others < 12) > 1:
                continue  # another point lies over it
            red, green, _ = image[v - 1 : v + 2, u - 1 : u + 2].reshape(-1, 3).mean(axis=0)
            if id in rejected.get(t_ns, ()):
                assert red > green
                reds += 1
            else:
                assert green > 60
                greens += green > red
    assert reds > 0
    assert greens > 100


def test_the_event_is_among_the_moments(dated: Path, pictures: Path) -> None:
    messages = messages_of(dated)
    shown = footage(messages, explain(messages), pictures)
    told = [(t_s, words) for t_s, words, _ in shown.moments if words]
    assert any(words == "event 1, slip" and abs(t_s - SLIPPED_S) < 1 for t_s, words in told)
    assert any(words.startswith("before event 1") for _, words in told)


def test_pictures_without_times_are_one_a_frame(
    pelorus: Command, log: Path, tmp_path: Path
) -> None:
    frames = frames_of(log)
    left = black(tmp_path / "left", [f"{k:06d}" for k in range(len(frames))], size_of(log))
    shown = tmp_path / "page.html"
    pelorus("explain", log, "--page", shown, "--pictures", left)
    packed = re.findall(r'src="data:image/webp;base64,([^"]+)"', shown.read_text())
    assert len(packed) > 10
    assert unpacked(b64decode(packed[3])).max() > 150
    (left / "000000.png").unlink()
    other = tmp_path / "other.html"
    said = pelorus("explain", log, "--page", other, "--pictures", left, status=1).err
    assert f"{len(frames) - 1} pictures whose names are no times" in said
    assert not other.exists()


def test_pictures_of_something_else_are_refused(
    pelorus: Command, log: Path, dated: Path, pictures: Path, tmp_path: Path
) -> None:
    shown = tmp_path / "page.html"

    def refused(recorded: Path, source: Path) -> str:
        words = pelorus("explain", recorded, "--page", shown, "--pictures", source, status=1).err
        assert not shown.exists()
        return " ".join(words.split())

    assert "of another drive" in refused(log, pictures)
    names = [str(10**16 + frame.t_ns) for frame in frames_of(log)]
    small = black(tmp_path / "small", names, (320, 240))
    assert "pictures of 320 x 240 pixels" in refused(dated, small)
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "holds no picture" in refused(log, empty)
    assert "error" in refused(log, tmp_path / "nowhere")
    assert "error" in refused(log, tmp_path / "nowhere.mcap")
    assert "--page" in pelorus("explain", log, "--pictures", pictures, status=2).err


def test_raw_pictures_are_rectified_as_for_tracking(
    pelorus: Command, real: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = real("images/euroc-v101-start/mav0/cam0/data.csv").parents[2]
    made, shown = tmp_path / "made.plr", tmp_path / "page.html"
    pelorus("convert", "euroc", folder, made)
    pelorus("explain", made, "--page", shown, "--pictures", folder)
    packed = re.findall(r'src="data:image/webp;base64,([^"]+)"', shown.read_text())
    assert len(packed) == MOMENTS_MOST
    first = unpacked(b64decode(packed[0])).mean(axis=2)
    raw = Image.open(sorted((folder / "mav0/cam0/data").glob("*.png"))[0]).convert("L")
    same = np.asarray(raw.resize(first.shape[::-1]), np.float64)
    assert np.abs(first - same).mean() > 8  # a lens bends what a rectified picture has straight


def test_a_picture_brings_the_cursor_to_its_frame(
    pelorus: Command, dated: Path, pictures: Path, tmp_path: Path
) -> None:
    shown = tmp_path / "page.html"
    pelorus("explain", dated, "--page", shown, "--pictures", pictures)
    with tab(Tab) as browser:
        browser.open(shown, 390)
        assert browser.does("document.documentElement.scrollWidth") <= 390
        at = browser.does(
            "(() => { const b = document.querySelectorAll('.moment')[5]; b.click(); "
            "return Number(b.dataset.at) })()"
        )
        browser.settle()
        assert browser.does("window.pelorus.t[window.pelorus.view.at]") == pytest.approx(
            at, abs=2e-3
        )
        marked = "[...document.querySelectorAll('.moment')].findIndex((b) => b.matches('.now'))"
        assert browser.does(marked) == 5
        assert browser.does("document.querySelector('.strip').scrollLeft") > 0
        assert browser.troubles == []
