# SPDX-License-Identifier: MIT
"""Tables for the page: settings in force, calibration given and estimated, and the recording's
own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pelorus.report.page import PageTable
from pelorus.report.words import NONE
from pelorus.wire.calibrated import last_calibrated
from pelorus.wire.frames import Config, Header, Message, Text
from pelorus.wire.schema import DEFAULTS
from pelorus.wire.settings import describe

SEVERITIES = ("", "warning", "error")


def tables_of(messages: Sequence[Message]) -> list[PageTable]:
    """Returns the tables, folded, for readers who look for them."""
    return [*_settings(messages), *_calibration(messages), *_remarks(messages)]


def _settings(messages: Sequence[Message]) -> Iterator[PageTable]:
    """Yields the settings; those that differ from the defaults first."""
    configs = [m for m in messages if isinstance(m, Config) and m.build_fingerprint]
    if not configs:
        return
    rows = []
    for id, value in configs[-1].settings.items():
        name, shown = describe(id, value)
        usual = DEFAULTS.get(name)
        other = usual is not None and not np.isclose(value, usual, rtol=1e-6, atol=0)
        rows.append((not other, name, shown, NONE if usual is None else describe(id, usual)[1]))
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
