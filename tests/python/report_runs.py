# SPDX-License-Identifier: MIT
"""What the tests of the report share: a recording, and the runs over it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from pelorus.errors import PelorusError
from pelorus.native.replay import Programs, find_programs
from pelorus.report.comparison import Comparison, carry_out, plan_runs, read_subject
from pelorus.wire.frames import Message
from replay_drive import BIN, encode

SETTINGS = ("--pixel-sigma", "0.5")


def built_programs() -> Programs:
    """Those of $PELORUS_BIN or build/bin; without them the test is skipped."""
    try:
        return find_programs(BIN)
    except PelorusError as error:
        pytest.skip(str(error))


def recorded(folder: Path, messages: list[Message]) -> Path:
    """Write a recording into the folder."""
    path = folder / "drive.plr"
    path.write_bytes(encode(messages))
    return path


def compared(
    path: Path, programs: Programs, *settings: str, also: Sequence[str] = ("course", "world")
) -> Comparison:
    """Carry out the runs of a report."""
    folder = path.parent / "runs"
    folder.mkdir()
    plans = plan_runs(programs, path, settings or SETTINGS, also)
    subject = read_subject(path)
    return Comparison(subject, [carry_out(plan, subject, folder) for plan in plans])
