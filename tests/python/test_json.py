# SPDX-License-Identifier: MIT
"""`--json`: one object on the standard output, which says what the command tells in words."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run
from flight_logs import DIFFERENT, robots_log
from pelorus.program.console import print_json
from pelorus.wire.frames import Pose
from replay_drive import BIN, FRAMES, drive, encode


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "drive.plr"
    path.write_bytes(encode(drive()))
    return path


def test_a_report_has_the_figures_of_each_run(
    pelorus: Run, tmp_path: Path, recording: Path
) -> None:
    words = ("report", recording, "--out", tmp_path / "out", "--bin", BIN)
    found = json.loads(pelorus(*words, "--json").out)
    assert Path(found["report"]).is_file()
    told = pelorus(*words, "--force").out
    assert all(f"- {line}\n" in told for line in found["remarks"])
    assert told.startswith(f"{found['verdict']}\n")
    assert f"health: {found['health'][0]}\n" in told
    assert list(found["runs"]) == ["yours", "dead-reckoning"]
    assert found["runs"]["yours"]["frames"] == FRAMES
    used = re.search(r"^used +(\d+) +0$", told, re.M)
    assert used
    assert int(used[1]) == found["runs"]["yours"]["used"] > 0


def test_a_map_says_its_cells(pelorus: Run, tmp_path: Path, recording: Path) -> None:
    words = ("map", recording, "--out", tmp_path / "map", "--bin", BIN, "--height", -1, 3)
    found = json.loads(pelorus(*words, "--json").out)
    assert found["heights_m"] == [-1, 3]
    counts = [found[name] for name in ("free", "occupied", "unknown")]
    assert sum(counts) == found["width"] * found["height"] > 0
    told = pelorus(*words, "--force").out
    assert f"{counts[0]} free, {counts[1]} occupied, {counts[2]} not known" in told
    assert Path(found["map"]).read_text().count(f"x of the map is {found['right']} of") == 1


def test_a_comparison_names_the_first_difference(pelorus: Run, tmp_path: Path) -> None:
    messages: list[Any] = list(robots_log(tmp_path, drive()))
    log = tmp_path / "flight.plr"
    log.write_bytes(encode(messages))
    same = json.loads(pelorus("compare", log, "--bin", BIN, "--json").out)
    assert (same["verdict"], same["same"]) == ("same", FRAMES)
    assert same["parts"][0]["first"] is None
    k = [i for i, m in enumerate(messages) if isinstance(m, Pose) and m.after_stereo][3]
    messages[k] = replace(messages[k], p_WB_m=messages[k].p_WB_m + np.array([0.25, 0, 0]))
    log.write_bytes(encode(messages))
    found = json.loads(pelorus("compare", log, "--bin", BIN, "--json", status=DIFFERENT).out)
    assert (found["verdict"], found["same"]) == ("different", FRAMES - 1)
    (part,) = found["parts"]
    assert part["first"]["frame"] == 4
    assert part["first"]["pose"] == ["position"]
    assert part["largest"]["position_m"] == pytest.approx(0.25)
    assert part["robot"] == part["desk"]


def test_what_is_not_finite_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"a": [1.5, float("nan")], "b": {"c": (float("inf"),)}, "d": "\x1b\u202e"})
    found = json.loads(capsys.readouterr().out)
    assert found == {"a": [1.5, None], "b": {"c": [None]}, "d": "\x1b\u202e"}
