# SPDX-License-Identifier: MIT
"""The page of `report`, `explain` and `check`: what it says as text, what its script shows in
Chromium at two widths, and that nothing of a recording is taken for markup.
"""

from __future__ import annotations

import json
import re
import zlib
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Tab, tab
from converted import Run as Command
from pelorus.explain import explain
from pelorus.report import answers, page
from pelorus.report.curves import Curves
from pelorus.report.packed import Packer
from pelorus.report.page import Answer, PageTable
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Header, Kind, Landmark, Message, Pose, Report, Role, Truth
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import unpack_symmetric
from replay_drive import SECOND as S
from replay_drive import drive, encode, header, run

WIDTHS = {"desktop": 1280, "phone": 390}
EVIL = '</script><img src=x onerror="window.evil=1"><b>&'
SLIPPED_S = 12.0


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> list[Message]:
    """Returns the log of a drive that slips."""
    folder = tmp_path_factory.mktemp("page")
    mishaps = Mishaps(slip=0.5, slip_span=Span(SLIPPED_S, 3.0))
    recording = simulate(Options(seed=4, duration_s=25.0, mishaps=mishaps)).recording
    recording.with_header(name=EVIL).write(folder / "in.plr")
    run(folder / "in.plr", "--quiet", "--out", folder / "log.plr")
    return messages_of(folder / "log.plr")


@pytest.fixture
def written(tmp_path: Path, log: list[Message]) -> Path:
    path = tmp_path / "page.html"
    page.write(path, answers.of_explanation(explain(log), EVIL), Curves(log))
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Tab]:
    with tab(Tab) as opened:
        yield opened


def data_of(path: Path) -> Any:
    found = re.search(r'id="data">(.*?)</script>', path.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


# --- without a browser ----------------------------------------------------------------------------


def test_columns_are_read_back_as_exactly_as_a_screen_shows() -> None:
    chance = np.random.default_rng(1)
    values = np.cumsum(chance.normal(size=5000))
    values[[0, 17, 4999]] = np.nan
    packer = Packer()
    first = packer.add(np.zeros(3))
    column = packer.add(values)
    packed = zlib.decompress(b64decode(packer.text()))
    high, low = np.frombuffer(packed, np.uint8)[column["at"] :][: 2 * 5000].reshape(2, -1)
    whole = np.cumsum((high.astype(np.int64) << 8) + low) % (1 << 16)
    back = np.where(whole > 0, column["low"] + (whole - 1) * column["step"], np.nan)
    assert np.isnan(back).tolist() == np.isnan(values).tolist()
    assert np.nanmax(np.abs(back - values)) <= np.ptp(values[1:-1][~np.isnan(values[1:-1])]) / 1e5
    assert first == {"at": 0, "count": 3, "low": 0.0, "step": 0.0}
    nothing = packer.add(np.full(2, np.nan))
    assert nothing["low"] == 0.0


def test_a_column_beyond_doubles_is_a_gap_there() -> None:
    column = Packer().add(np.array([1.0, -1.7e308, 1.7e308, 3.0]))
    assert (column["low"], column["count"]) == (1.0, 4)
    assert column["step"] > 0


def test_the_page_is_whole_says_it_first_and_fetches_nothing(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    assert text.index("What happened") < text.index('id="bar"')
    assert "the odometry says" in text
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert 'http-equiv="Content-Security-Policy" content="default-src \'none\'' in text
    assert "uPlot (v1.6.32)" in text
    assert text.count("</script>") == 5


def test_names_of_a_recording_are_no_markup(written: Path) -> None:
    text = written.read_text(encoding="utf-8")
    assert EVIL not in text
    assert "<img" not in text


def test_a_log_without_truth_or_evidence_has_a_page_too(tmp_path: Path, log: list[Message]) -> None:
    bare = [m for m in log if not isinstance(m, Truth | Evidence)]
    path = tmp_path / "bare.html"
    page.write(path, answers.of_explanation(explain(bare), "bare"), Curves(bare))
    titles = [chart["title"] for chart in data_of(path)["charts"]]
    assert titles[:2] == ["Position uncertainty", "Rotation uncertainty"]
    assert not {"Doubt", "Weight", "NEES / 6"} & set(titles)
    assert "no EVIDENCE" in path.read_text(encoding="utf-8")


def test_what_a_page_leaves_out_it_says(
    tmp_path: Path, log: list[Message], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pelorus.report.curves.FRAMES_MOST", 200)
    monkeypatch.setattr("pelorus.report.landmarks.LANDMARKS_MOST", 5)
    monkeypatch.setattr("pelorus.report.landmarks.REJECTIONS_MOST", 7)
    path = tmp_path / "less.html"
    page.write(path, answers.of_explanation(explain(log), "less"), Curves(log))
    data = data_of(path)
    assert 100 <= data["t"]["count"] <= 201
    assert data["landmarks"]["id"]["count"] == 5
    assert data["landmarks"]["rejected"]["id"]["count"] <= 7
    text = path.read_text(encoding="utf-8")
    assert re.search(r"Left out, to keep the page small: \d+ of \d+ frames, all but every", text)
    assert re.search(r"\d+ of \d+ landmarks", text)
    assert "rejections" in text


def test_six_minutes_at_20_Hz_are_a_tenth_of_six_megabytes(tmp_path: Path) -> None:
    chance = np.random.default_rng(2)
    count, period = 7_200, 50_000_000
    messages: list[Message] = [header()]
    bias, nu = chance.normal(size=(count, 6)), chance.normal(size=(count, 6))
    p, nis = np.cumsum(chance.normal(size=(count, 3)), axis=0), chance.chisquare(200, count)
    for k in range(count):  # whose every number is as new as noise can be
        t = S + k * period
        variance = np.diag(np.exp(chance.normal(size=6)))
        pose = Pose(
            t, p[k], covariance=variance[np.tril_indices(6)], bias=bias[k], after_stereo=True
        )
        messages.append(replace(pose, bias_variance=bias[k] ** 2))
        points, gated, us = (int(chance.integers(most)) for most in (200, 20, 5000))
        report = Report(t, Kind.STEREO, matched=points, used=points, nis=nis[k], nis_dof=200)
        messages.append(replace(report, gated=gated, update_us=us))
        messages.append(Evidence(t, nu[k], statistic=nis[k], weight=1 + abs(nu[k, 0])))
    messages += [Landmark(k, nu[k, :3], bias[k] ** 2, Role.EVICTED, t, k) for k in range(2000)]
    path = tmp_path / "hour.html"
    page.write(path, Answer("hour", "good", "nothing happened"), Curves(messages))
    assert data_of(path)["t"]["count"] == count
    alone = tmp_path / "alone.html"
    page.write(alone, Answer("two", "good", "nothing happened"), Curves(messages[:7]))
    assert path.stat().st_size - alone.stat().st_size <= 0.6e6


def test_a_verdict_without_a_run_is_a_page_without_a_script(tmp_path: Path) -> None:
    path = tmp_path / "stopped.html"
    page.write(path, Answer("check", "bad", "do not use it", lines=["axes < turned"]))
    text = path.read_text(encoding="utf-8")
    assert "axes &lt; turned" in text
    assert "<script" not in text


def test_explain_and_check_write_it(pelorus: Command, tmp_path: Path) -> None:
    recording, explained, checked = (tmp_path / n for n in ("in.plr", "e.html", "c.html"))
    recording.write_bytes(encode(drive(60)))
    pelorus("explain", recording, "--page", explained)
    assert data_of(explained)["t"]["count"] == 60
    wrong = tmp_path / "no" / "e.html"
    assert "cannot be written" in pelorus("explain", recording, "--page", wrong, status=1).err
    done = tmp_path / "tuned.conf"
    pelorus("check", recording, "--out", done, "--page", checked, status=None)
    text = checked.read_text(encoding="utf-8")
    assert "Pelorus check: in.plr" in text
    assert ("Settings to use" in text) is done.exists()


# --- in a browser ---------------------------------------------------------------------------------


def state(browser: Tab) -> Any:
    return browser.does("window.pelorus.view")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS.values(), ids=WIDTHS.keys())
def test_the_page_shows_the_event_and_fits_the_screen(
    browser: Tab, written: Path, width: int, dark: bool
) -> None:
    browser.troubles.clear()
    browser.open(written, width, dark=dark)
    browser.settle()
    assert browser.troubles == []
    assert browser.does("document.documentElement.scrollWidth") <= width
    assert browser.does("window.evil === undefined && document.title") == EVIL
    assert browser.does("document.getElementById('now').textContent").startswith("1")
    seen = state(browser)
    assert seen["from"] < SLIPPED_S < seen["to"]
    small = "[...document.querySelectorAll('button, input')].filter((b) => b.offsetHeight < 30)"
    assert browser.does(f"{small}.length") == 0
    sizes = "[...document.querySelectorAll('body *')].filter((e) => e.childNodes.length && "
    sizes += "parseFloat(getComputedStyle(e).fontSize) < 12).map((e) => e.tagName)"
    assert browser.does(sizes) == []
    paper = browser.does("getComputedStyle(document.body).backgroundColor")
    assert (paper == "rgb(255, 255, 255)") is not dark


def test_cursor_and_zoom_go_through_all_of_the_page(browser: Tab, written: Path) -> None:
    browser.open(written, 1280)
    browser.does("window.pelorus.drawAll()")
    browser.settle()
    box = "(() => { const b = document.querySelectorAll('.u-over')[4].getBoundingClientRect(); "
    box += "window.scrollTo(0, b.top + window.scrollY - 300); "
    box += "const c = document.querySelectorAll('.u-over')[4].getBoundingClientRect(); "
    box += "return [c.left, c.top, c.width, c.height] })()"
    left, top, width, height = browser.does(box)
    before = state(browser)
    y = top + height / 2
    browser.mouse((left + 0.25 * width, y), (left + 0.5 * width, y), (left + 0.75 * width, y))
    after = state(browser)
    span = before["to"] - before["from"]
    assert after["from"] == pytest.approx(before["from"] + 0.25 * span, abs=0.03 * span)
    assert after["to"] == pytest.approx(before["from"] + 0.75 * span, abs=0.03 * span)
    legends = "[...document.querySelectorAll('.u-legend')].map((l) => "
    legends += "l.querySelector('.u-value').textContent)"
    browser.does("window.pelorus.go(150)")
    browser.settle()
    now = browser.does("document.getElementById('now').textContent")
    t = browser.does("window.pelorus.t[150]")
    assert now.startswith(f"{t:.2f} s")
    assert set(browser.does(legends)) == {f"{t:.2f}"}


def test_keys_reach_everything(browser: Tab, written: Path) -> None:
    browser.open(written, 1280)
    browser.press("0")
    whole = state(browser)
    assert whole["from"] == 0
    browser.press("+")
    browser.settle()
    nearer = state(browser)
    assert nearer["to"] - nearer["from"] == pytest.approx((whole["to"] - whole["from"]) / 2, 0.01)
    browser.press("Home")
    assert state(browser)["at"] == 0
    browser.press("ArrowRight")
    assert state(browser)["at"] == 1
    browser.press("n")
    at = browser.does("window.pelorus.t[window.pelorus.view.at]")
    assert at == pytest.approx(SLIPPED_S, abs=1.0)
    paper = "getComputedStyle(document.body).backgroundColor"
    light = browser.does(paper)
    browser.press("d")
    assert browser.does(paper) != light
    focus = "(() => { const all = [...document.querySelectorAll('button, input, a, summary')]; "
    focus += "return all.filter((e) => e.offsetParent && e.tabIndex < 0).length })()"
    assert browser.does(focus) == 0


def test_a_landmark_tells_its_history(browser: Tab, written: Path, log: list[Message]) -> None:
    rejected = [m.rejected for m in log if isinstance(m, Evidence) and len(m.rejected)]
    ids, counts = np.unique(np.concatenate(rejected)["id"], return_counts=True)
    data = data_of(written)
    browser.open(written, 390)
    told = ""
    for id in ids[np.argsort(-counts)][:40].tolist():
        browser.does(
            f"(() => {{ const i = document.getElementById('id'); i.value = {id}; "
            "i.dispatchEvent(new Event('change')) })()"
        )
        told = browser.does("document.getElementById('landmark').textContent")
        if "rejected by the gate" in told:
            break
    assert data["landmarks"]["id"]["count"] > 0
    assert re.search(r"Landmark \d+ at \(", told)
    assert re.search(r"seen in \d+ frames, from [\d.]+ to [\d.]+ s", told)
    assert re.search(r"rejected by the gate.*: \d+ times", told)
    browser.does("document.querySelector('#landmark button').click()")
    browser.settle()
    assert state(browser)["at"] > 0


def test_the_map_turns_by_keys_and_outlines_are_the_projected_covariances(
    browser: Tab, written: Path, log: list[Message]
) -> None:
    browser.open(written, 1280)
    at = state(browser)["at"]
    browser.does("document.getElementById('map').focus()")
    press = "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {{key: {!r}, "
    press += "shiftKey: {}, bubbles: true, cancelable: true}}))"
    for key in ("ArrowRight", "ArrowDown", "ArrowDown"):
        browser.does(press.format(key, "false"))
    turned = browser.does("window.pelorus.map")
    assert (turned["yaw"], turned["pitch"]) == (10, 20)
    assert state(browser)["at"] == at
    rows = np.array(turned["rows"])
    assert np.allclose(rows @ rows.T, np.eye(2))
    made = sorted(
        {m.id: m for m in log if isinstance(m, Landmark)}.values(), key=lambda m: -m.times_seen
    )
    way = np.array([m.p_WB_m for m in log if isinstance(m, Pose) and m.after_stereo])
    compared = 0
    for k, m in enumerate(made[:60]):
        P = unpack_symmetric(np.asarray(m.covariance)[None], 3)[0]
        if 3 * np.sqrt(np.linalg.eigvalsh(P)[2]) > np.linalg.norm(way - m.p_W_m, axis=1).min():
            continue
        long, short, _ = browser.does(f"window.pelorus.map.outline({k})")
        due = 3 * turned["scale"] * np.sqrt(np.linalg.eigvalsh(rows @ P @ rows.T))
        assert [short, long] == pytest.approx(due, rel=2e-3)
        compared += 1
    assert compared > 20
    browser.does(press.format("ArrowRight", "true"))
    assert browser.does("window.pelorus.map.x") != turned["x"]
    browser.does("document.getElementById('side').click()")
    assert browser.does("window.pelorus.map.pitch") == 90


def test_a_true_angle_is_dashed_in_the_colour_of_the_estimate(browser: Tab, written: Path) -> None:
    browser.open(written, 1280)
    browser.does("window.pelorus.drawAll()")
    browser.settle()
    rows = "[...document.querySelectorAll('.u-series')].map((r) => "
    rows += "[r.querySelector('.u-label').textContent.split(':')[0], "
    rows += "r.querySelector('.u-marker').style.borderColor])"
    colours = dict(browser.does(rows))
    for name in ("roll", "pitch", "yaw"):
        assert colours[f"{name} true"] == colours[name], colours
    assert len({colours[name] for name in ("roll", "pitch", "yaw")}) == 3


def test_another_log_stands_beside_curve_by_curve(
    browser: Tab, tmp_path: Path, log: list[Message]
) -> None:
    beside = Curves([m for m in log if not isinstance(m, Evidence)])
    path = tmp_path / "beside.html"
    page.write(path, answers.of_explanation(explain(log), "two"), Curves(log, beside=beside))
    charts = {chart["title"]: chart["lines"] for chart in data_of(path)["charts"]}
    assert [line["name"] for line in charts["Innovations"]] == ["NIS", "low", "high", "NIS, beside"]
    assert charts["Innovations"][3]["like"] == 0
    assert len(charts["Doubt"]) == 1  # the other log has no evidence
    browser.troubles.clear()
    browser.open(path, 390)
    browser.does("window.pelorus.drawAll()")
    browser.settle()
    assert browser.troubles == []
    rows = "[...document.querySelectorAll('#ribbons .row span')].map((s) => s.textContent)"
    assert browser.does(rows)[:2] == ["health", "health, beside"]
    values = "[...document.querySelectorAll('.u-legend')].flatMap((l) => "
    values += "[...l.querySelectorAll('.u-series')]).filter((r) => "
    values += "r.textContent.startsWith('NIS')).map((r) => r.querySelector('.u-value').textContent)"
    own, there = browser.does(values)
    assert own == there
    assert float(own) > 0


def test_explain_sets_two_settings_side_by_side(pelorus: Command, tmp_path: Path) -> None:
    recording, shown = tmp_path / "in.plr", tmp_path / "two.html"
    recording.write_bytes(encode(drive(60)))
    assert "--page" in pelorus("explain", recording, "--beside-set", "bias=on", status=2).err
    pelorus("explain", recording, "--page", shown, "--beside-set", "pixel-sigma=2.5")
    text = shown.read_text(encoding="utf-8")
    assert "Dashed curves are those of pixel-sigma=2.5." in text
    assert re.search(r"<td>pixel-sigma</td><td>[\d.]+ px</td><td>2.5 px</td>", text)
    assert "Side by side" in text
    assert "Drift by length" in text


def test_a_page_without_its_data_says_so_and_keeps_its_text(
    browser: Tab, tmp_path: Path, written: Path
) -> None:
    cut = tmp_path / "cut.html"
    text = written.read_text(encoding="utf-8")
    cut.write_text(re.sub(r'(id="columns">.{200}).*?<', r"\1<", text, flags=re.DOTALL))
    browser.open(cut, 390)
    assert "missing or damaged" in browser.does("document.getElementById('now').textContent")
    assert "slip" in browser.does("document.body.textContent")


def test_a_log_of_two_frames_has_a_page(browser: Tab, tmp_path: Path) -> None:
    recording, log = tmp_path / "in.plr", tmp_path / "log.plr"
    recording.write_bytes(
        encode([replace(m, name="two") if isinstance(m, Header) else m for m in drive(2)])
    )
    run(recording, "--quiet", "--out", log)
    messages = messages_of(log)
    path = tmp_path / "two.html"
    page.write(path, answers.of_explanation(explain(messages), "two"), Curves(messages))
    browser.troubles.clear()
    browser.open(path, 390)
    browser.settle()
    assert browser.troubles == []
    assert state(browser)["at"] == 0


def test_charts_are_drawn_when_they_come_near_the_screen(browser: Tab, written: Path) -> None:
    """That makes the page of an hour's log ready in time; a zoom holds for the later ones."""
    charts = "document.querySelectorAll('.chart').length"
    drawn = "document.querySelectorAll('.chart .uplot').length"
    browser.open(written, 1280)
    browser.settle()
    few, every = browser.does(drawn), browser.does(charts)
    assert 0 < few < every
    browser.does("window.pelorus.zoom(2, 5)")
    browser.settle()
    browser.does("window.scrollTo(0, document.body.scrollHeight)")
    browser.settle()
    assert browser.does(drawn) > few
    browser.does("window.pelorus.drawAll()")
    browser.settle()
    assert browser.does(drawn) == every
    legends = "[...document.querySelectorAll('.u-legend')].map((l) => "
    legends += "l.querySelector('.u-value').textContent)"
    assert len(set(browser.does(legends))) == 1
    assert (state(browser)["from"], state(browser)["to"]) == (2, 5)


def test_a_band_beyond_the_axis_is_told_and_what_has_no_value_is_said_in_words(
    browser: Tab, tmp_path: Path
) -> None:
    recording, log = tmp_path / "in.plr", tmp_path / "log.plr"
    recording.write_bytes(encode(drive()))
    run(recording, "--quiet", "--mode", "dead_reckoning", "--velocity-sigma", "50", "--out", log)
    messages = messages_of(log)
    path = tmp_path / "blind.html"
    page.write(path, answers.of_explanation(explain(messages), "blind"), Curves(messages))
    empty = {c["title"]: c["empty"] for c in data_of(path)["charts"] if "empty" in c}
    assert "no frame was used" in empty["Innovations"]
    assert "no point matched" in empty["Rejected"]
    browser.open(path, 390)
    browser.does("window.pelorus.drawAll()")
    browser.settle()
    words = browser.does("document.getElementById('charts').textContent")
    assert all(text in words for text in empty.values())
    assert "Position error, x (m) the band leaves the axis: to -" in words
    assert browser.does("document.querySelectorAll('.chart .uplot').length") == len(
        [c for c in data_of(path)["charts"] if "empty" not in c]
    )


def test_tables_are_whole_on_a_phone(browser: Tab, tmp_path: Path) -> None:
    path = tmp_path / "table.html"
    rows = [[f"column {k} m" for k in range(9)], *([f"{row}.1234"] * 9 for row in range(3))]
    page.write(
        path,
        Answer(
            "t",
            "good",
            "",
            tables=[PageTable("few", [r[:5] for r in rows]), PageTable("many", rows)],
        ),
    )
    browser.open(path, 390)
    widths = "[...document.querySelectorAll('.wide')].map((w) => w.scrollWidth - w.clientWidth)"
    assert browser.does(widths) == [0, 0]
    browser.open(path, 1280)
    assert browser.does(widths) == [0, 0]
