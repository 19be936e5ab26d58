# SPDX-License-Identifier: MIT
"""What mode mapping leaves of error on Starry Night is the recording's own (docs/COURSE.md).

The oracle is a least-squares fit of each landmark by itself, from all of its observations and the
true poses. It shares no code with the filter.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from converted import Run
from pelorus.io.tracks import project
from pelorus.wire import framing
from pelorus.wire.frames import Header, Landmark, Message, Stereo, Truth
from replay_drive import ROOT
from replay_drive import run as run_replay

STRAY_PX = 31.6  # a residual beyond that is no sighting of this landmark
STEPS = 20
SMALL_M = 1e-5


class Seen(NamedTuple):
    """Where from, and at which pixels, a landmark was seen."""

    R_WB: Any
    p_WB_m: Any
    pixels: Any


@pytest.fixture
def starry(pelorus: Run, real: Callable[[str], Path], tmp_path: Path) -> Path:
    path = tmp_path / "starry.plr"
    pelorus("convert", "starry-night", real("starry-night/dataset3.mat"), path)
    return path


def sightings(messages: list[Message]) -> dict[int, Seen]:
    poses = {m.t_ns: m for m in messages if isinstance(m, Truth)}
    rows: dict[int, list[Any]] = defaultdict(list)
    for frame in messages:
        if isinstance(frame, Stereo):
            pose = poses[frame.t_ns]
            for id, pixels in zip(frame.ids.tolist(), frame.pixels.astype(float), strict=True):
                rows[id].append((pose.R_WB, pose.p_WB_m, pixels))
    return {id: Seen(*map(np.array, zip(*seen, strict=True))) for id, seen in rows.items()}


def residual(header: Header, seen: Seen, point: Any) -> Any:
    s = np.einsum("nij,ni->nj", seen.R_WB, point - seen.p_WB_m)
    return seen.pixels - project(header.camera, s @ header.R_CB.T + header.t_CB_m)


def fitted(header: Header, seen: Seen, start: Any) -> Any:
    """Gauss and Newton, strays left out."""
    x = np.array(start, float)
    for _ in range(STEPS):
        r = residual(header, seen, x)
        ends = [(x - SMALL_M * e, x + SMALL_M * e) for e in np.eye(3)]
        columns = [residual(header, seen, a) - residual(header, seen, b) for a, b in ends]
        J = np.stack(columns, axis=-1) / (2 * SMALL_M)
        good = np.linalg.norm(r, axis=1) < STRAY_PX
        A, b = J[good].reshape(-1, 3), r[good].reshape(-1)
        x = x + np.linalg.lstsq(A, b, rcond=None)[0]
    return x


def test_mapping_is_as_good_as_a_fit_of_each_landmark_by_itself(
    pelorus: Run, starry: Path, tmp_path: Path
) -> None:
    messages = [frame.message for frame in framing.read_file(starry)[0]]
    header = next(m for m in messages if isinstance(m, Header))
    known = {m.id: m.p_W_m for m in messages if isinstance(m, Landmark)}
    seen = sightings(messages)
    error = [np.linalg.norm(fitted(header, seen[id], p) - p) for id, p in known.items()]
    oracle_rms, oracle_median = float(np.sqrt(np.mean(np.square(error)))), float(np.median(error))
    config = ROOT / "tools" / "config" / "starry-night.conf"
    log = tmp_path / "mapped.plr"
    options = (
        "--config",
        config,
        "--pixel-sigma",
        "5",
        "--camera-turn-sigma",
        "0",
        "--mode",
        "mapping",
        "--gate",
        "off",
        "--quiet",
    )
    run_replay(starry, *options, "--out", log)
    said = pelorus("evaluate", log, "--truth", starry, "--json")
    found = json.loads(said.out)
    assert found["map_landmarks"] == 20
    assert found["map_median_m"] < 1.2 * oracle_median
    assert found["map_rms_m"] < 1.5 * oracle_rms
    assert found["map_nees_per_dof"] > 10  # it claims an eighth of that, ...


def test_residuals_at_the_true_landmarks_do_not_average_out(starry: Path) -> None:
    """... for it takes for white noise what the recording's poses and calibration are off by."""
    messages = [frame.message for frame in framing.read_file(starry)[0]]
    header = next(m for m in messages if isinstance(m, Header))
    known = {m.id: m.p_W_m for m in messages if isinstance(m, Landmark)}
    beyond = []
    for id, seen in sightings(messages).items():
        r = residual(header, seen, known[id])
        r = r[np.linalg.norm(r, axis=1) < STRAY_PX]
        beyond.append(np.abs(r.mean(axis=0)) / (r.std(axis=0) / np.sqrt(len(r))))
    assert np.median(beyond) > 3  # standard errors; white noise: 0.67
