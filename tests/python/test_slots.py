# SPDX-License-Identifier: MIT
"""`pelorus check` replays with as few slots as change nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from pelorus.check import slots
from pelorus.check.options import Settings
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


# Model body takes what its landmarks have in common from those out of sight, too: the usual inverse
# range, at which those that are poorly known are linearised, and the motion that corrections share.
# Both are of second order, and larger where points are few and noisy.
FEW_AND_NOISY = (
    *("--seed", "3", "--duration", "30", "--lap", "10", "--twist-rate", "20"),
    *("--observations", "30", "--pixel-sigma", "1.5"),
    *("--velocity-sigma", "0.3", "--gyro-sigma", "0.03"),
)
DRIVES = {"usual": (("--duration", "20"), 1e-3, 1e-3), "few, noisy": (FEW_AND_NOISY, 6e-3, 1e-3)}


@pytest.mark.parametrize("name", DRIVES)
def test_landmarks_that_never_return_change_little_in_body_and_no_bit_in_world(
    name: str, tmp_path: Path, pelorus: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, simulated = built_programs().float32, tmp_path / "drive.plr"
    options, cost, bias = DRIVES[name]
    pelorus("simulate", simulated, *options)
    models: list[Settings] = [{}, {"model": "world"}]
    few = Bench(program, simulated, tmp_path).run_all(models)
    monkeypatch.setattr(slots.Slots, "sparing", lambda _, settings: settings)
    all_of_them = Bench(program, simulated, tmp_path).run_all(models)
    for some, every in zip(few, all_of_them, strict=True):
        assert (some.matched, some.frames) == (every.matched, every.frames)
        assert some.matched > 5000
    assert few[0].cost != all_of_them[0].cost  # the slots were spared
    assert few[0].cost == pytest.approx(all_of_them[0].cost, abs=cost)
    assert few[0].bias == pytest.approx(all_of_them[0].bias, abs=bias)
    assert few[1].cost == all_of_them[1].cost
    assert (few[1].by_frame == all_of_them[1].by_frame).all()
    assert (few[1].bias == all_of_them[1].bias).all()
