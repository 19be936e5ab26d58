# SPDX-License-Identifier: MIT
"""`pelorus check` replays with as few slots as change nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from pelorus.check import slots
from pelorus.check.outcome import Bench
from pelorus.wire.frames import Config, Message, Stereo
from pelorus.wire.settings import IDS
from report_runs import built_programs


def seen(*frames: Sequence[int]) -> list[Message]:
    return [
        Stereo(k, np.array(ids, np.uint32), np.zeros((len(ids), 4), np.float32))
        for k, ids in enumerate(frames)
    ]


def test_slots_are_needed_for_what_is_in_sight_or_comes_back() -> None:
    assert slots.needed(seen([1, 2], [2, 3], [3, 4, 5]), 100) == 3  # who has gone needs none
    assert slots.needed(seen([1, 2], [3], [4, 5], [2]), 100) == 5  # 2 must not be evicted for 5
    assert slots.needed(seen([1, 2], [3], [4, 5], [2]), 4) == 4
    assert slots.needed(seen([]), 100) == 1
    asked = Config({IDS["slots"]: 20.0})
    assert slots.Slots([asked, *seen([1, 2])]).sparing({}) == {"slots": "2"}
    assert slots.Slots([asked, *seen(range(30))]).sparing({}) == {}
    assert slots.Slots(seen([1, 2])).sparing({"slots": "1"}) == {"slots": "1"}
    assert slots.Slots(seen([1, 2])).sparing({"mode": "mapping"}) == {"mode": "mapping"}


def test_landmarks_that_never_return_change_no_likelihood(
    tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, simulated = built_programs().float32, tmp_path / "drive.plr"
    pelorus("simulate", simulated, "--duration", 20)
    few = Bench(program, simulated, tmp_path).run({})
    monkeypatch.setattr(slots.Slots, "sparing", lambda _, settings: settings)
    all_of_them = Bench(program, simulated, tmp_path).run({})
    assert (few.matched, few.frames) == (all_of_them.matched, all_of_them.frames)
    assert few.cost == pytest.approx(all_of_them.cost, abs=1e-3)
    assert few.bias == pytest.approx(all_of_them.bias, abs=1e-3)
