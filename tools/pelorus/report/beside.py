# SPDX-License-Identifier: MIT
"""Tables of one log, or of two side by side.

Settings that differ, figures, drift by length; settings in force, calibration given and estimated,
and the recording's own remarks.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pelorus.evaluate.evaluation import Accuracy, Drift, drifts
from pelorus.explain.explanation import Explanation
from pelorus.report.curves import BESIDE
from pelorus.report.page import PageTable
from pelorus.report.words import NONE, number
from pelorus.wire.calibrated import last_calibrated
from pelorus.wire.frames import Config, Header, Message, Text
from pelorus.wire.schema import DEFAULTS
from pelorus.wire.settings import describe

DRIFT = (
    "How far a piece of the way of that length is off, wherever it begins, first poses aligned: "
    "RMS over the starts, as KITTI counts it."
)


class NamedLog(NamedTuple):
    """A log with its name."""

    name: str
    found: Explanation
    accuracy: Accuracy | None
    messages: Sequence[Message]


def drift_table(logs: Sequence[NamedLog]) -> list[PageTable]:
    """Returns a table of drift by length; none where no log has a truth."""
    by_log = {
        log.name: {drift.length_m: drift for drift in drifts(log.accuracy)}
        for log in logs
        if log.accuracy is not None
    }
    lengths = sorted({length for found in by_log.values() for length in found})
    if not lengths:
        return []
    head = ["position m", "%", "rotation deg", "starts"]
    whose = ["", f"{BESIDE} "] if len(by_log) > 1 else [""]
    rows = [["length", *(f"{who}{name}" for who in whose for name in head)]]
    for length in lengths:
        cells = [_cells(found.get(length)) for found in by_log.values()]
        rows.append([f"{length:g} m", *itertools.chain(*cells)])
    return [PageTable("Drift by length (RPE)", rows, DRIFT, folded=True)]


def _cells(drift: Drift | None) -> list[str]:
    if drift is None:
        return [NONE] * 4
    figures = (drift.position_m, drift.percent, drift.rotation_deg)
    return [*(f"{x:.3g}" for x in figures), str(drift.starts)]


def side_by_side(first: NamedLog, second: NamedLog) -> list[PageTable]:
    """Returns tables of both logs' figures, and of the settings in which they differ."""
    head = ("", first.name, BESIDE)
    mine, theirs = dict(_figures(first)), dict(_figures(second))
    tables = [
        PageTable("Side by side", [head, *((key, x, theirs[key]) for key, x in mine.items())])
    ]
    if settings := list(_settings(first, second)):
        tables.append(PageTable("Settings that differ", [head, *settings]))
    return tables


def _figures(log: NamedLog) -> Iterator[tuple[str, str]]:
    cause = log.found.first
    yield "first cause", "nothing" if cause is None else str(cause.cause)
    yield "events", str(len(log.found.episodes))
    yield "good frames", f"{log.found.health.by_health['good']} of {log.found.health.frames}"
    figures = {} if log.accuracy is None else log.accuracy.figures
    for title, key in (
        ("err0 m", "err0_m"),
        ("ATE m", "ate_m"),
        ("rotation deg", "rot_deg"),
        ("NEES/6", "nees_per_dof"),
    ):
        yield title, number(figures.get(key))


def _settings(first: NamedLog, second: NamedLog) -> Iterator[tuple[str, ...]]:
    mine, theirs = (_in_force(log.messages) for log in (first, second))
    for id in sorted(mine.keys() | theirs.keys()):
        here, there = mine.get(id), theirs.get(id)
        if here != there:
            name = describe(id, 0.0)[0]
            yield name, *(NONE if x is None else describe(id, x)[1] for x in (here, there))


def _in_force(messages: Sequence[Message]) -> dict[int, float]:
    configs = [m for m in messages if isinstance(m, Config) and m.build_fingerprint]
    return configs[-1].settings if configs else {}


# --- settings, calibration and remarks of one log -------------------------------------------------


SEVERITIES = ("", "warning", "error")


def tables_of(messages: Sequence[Message]) -> list[PageTable]:
    """Returns the tables, folded, for readers who look for them."""
    return [*_all_settings(messages), *_calibration(messages), *_remarks(messages)]


def _all_settings(messages: Sequence[Message]) -> Iterator[PageTable]:
    """Yields the settings; those that differ from the defaults first."""
    rows = []
    for id, value in _in_force(messages).items():
        name, shown = describe(id, value)
        usual = DEFAULTS.get(name)
        other = usual is not None and not np.isclose(value, usual, rtol=1e-6, atol=0)
        rows.append((not other, name, shown, NONE if usual is None else describe(id, usual)[1]))
    if not rows:
        return
    rows.sort()
    changed = sum(not row[0] for row in rows)
    cells = [(row[1], row[2], row[3] if not row[0] else "") for row in rows]
    title = f"Settings in force: {changed} of {len(rows)} differ from the defaults"
    yield PageTable(title, [("setting", "value", "default"), *cells], folded=True)


def _calibration(messages: Sequence[Message]) -> Iterator[PageTable]:
    header = next((m for m in messages if isinstance(m, Header)), None)
    if header is None:
        return
    found = last_calibrated(messages)
    estimates = (
        {} if found is None else {part.key: (v, s, part.unit) for part, v, s in found.parts()}
    )
    camera = header.camera
    place = "  ".join(f"{x:+.4f}" for x in np.asarray(header.t_CB_m))
    turn = " / ".join(" ".join(f"{x:+.4f}" for x in row) for row in np.asarray(header.R_CB))
    rows = [
        (
            "focal lengths",
            f"{camera.fx_px:g}, {camera.fy_px:g} px",
            _estimate_words(estimates, "focal"),
        ),
        (
            "principal point",
            f"{camera.cx_px:g}, {camera.cy_px:g} px",
            _estimate_words(estimates, "centre_u", "centre_v"),
        ),
        ("baseline", f"{camera.baseline_m:g} m", _estimate_words(estimates, "baseline")),
        ("R_CB", turn, _estimate_words(estimates, "turn_x", "turn_y", "turn_z")),
        ("t_CB", f"{place} m", _estimate_words(estimates, "place_x", "place_y", "place_z")),
        ("camera's clock", "0", _estimate_words(estimates, "clock")),
    ]
    estimated = (
        f"{len(estimates)} numbers estimated" if estimates else "as given, nothing is estimated"
    )
    head = ("", "given", "estimated correction")
    yield PageTable(f"Calibration: {estimated}", [head, *rows], folded=True)


def _estimate_words(estimates: dict[str, tuple[float, float, str]], *keys: str) -> str:
    parts = [estimates[key] for key in keys if key in estimates]
    return ", ".join(f"{value:+.3g} ± {sigma:.2g} {unit}" for value, sigma, unit in parts) or NONE


def _remarks(messages: Sequence[Message]) -> Iterator[PageTable]:
    texts = [m for m in messages if isinstance(m, Text)]
    if texts:
        rows = [(SEVERITIES[min(m.severity, 2)], m.text) for m in texts]
        yield PageTable(
            f"What the recording says: {len(texts)} remarks", [("", "remark"), *rows], folded=True
        )
