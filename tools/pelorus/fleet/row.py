# SPDX-License-Identifier: MIT
"""A row of the fleet's table: what was found in one recording.

The same recording, settings and Pelorus give the same row, on whichever machine: no time of the day
and no running time is in it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

BROKEN = "broken"  # grade of a recording that could not be judged


@dataclass(frozen=True)
class Found:
    """A recording in the folder. Size and time of the last change tell whether it is the same."""

    folder: Path
    recording: str  # its path from the folder, with /
    bytes: int
    modified_ns: int

    @property
    def path(self) -> Path:
        return self.folder / self.recording


@dataclass(frozen=True)
class Row:
    """What was found in a recording; None where a figure cannot be had."""

    recording: str
    bytes: int
    modified_ns: int
    made_by: str  # digest of programs, tools and settings
    error: str | None = None  # why it could not be judged; then the figures are None
    # as `pelorus explain` says it
    grade: str = BROKEN  # good, care, bad, broken
    verdict: str | None = None
    cause: str | None = None  # one word; None: nothing is wrong
    why: list[str] | None = None
    what_to_set: list[str] | None = None
    faults: list[str] | None = None  # by name
    setup: list[str] | None = None
    remarks: list[str] | None = None
    events: int | None = None
    diverged: int | None = None  # events that are divergences
    first_cause: str | None = None
    first_s: float | None = None  # since the first frame
    first_words: str | None = None
    what_to_do: str | None = None
    duration_s: float | None = None
    frames: int | None = None
    good_share: float | None = None  # of the frames
    nis: float | None = None  # innovations a degree of freedom: 1 is expected
    gated_share: float | None = None  # of the matches
    damaged_frames: int | None = None  # left out
    pieces: int | None = None  # in which a long log was explained
    # as `pelorus evaluate` says it
    path_m: float | None = None
    truth_frames: int | None = None
    err0_m: float | None = None
    ate_m: float | None = None
    rot_deg: float | None = None
    nees_per_dof: float | None = None
    map_landmarks: int | None = None
    map_rms_m: float | None = None
    map_nees_per_dof: float | None = None
    # as `pelorus check` says it
    check_grade: str | None = None
    check_verdict: str | None = None
    check_changes: list[str] | None = None  # settings to change, as in a config file
    check_error: str | None = None

    @classmethod
    def broken(cls, found: Found, made_by: str, error: str) -> Row:
        """Returns the row of a recording that could not be judged."""
        return cls(found.recording, found.bytes, found.modified_ns, made_by, error, cause=BROKEN)

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Row:
        """Returns the row with these fields; a table of another version may lack some."""
        return cls(**{name: found[name] for name in COLUMNS if name in found})

    def is_of(self, found: Found, made_by: str) -> bool:
        """Returns whether judging the recording would give this row again.

        One with an error is judged anew: its worker may have died for want of memory.
        """
        mine = (self.recording, self.bytes, self.modified_ns, self.made_by)
        given = (found.recording, found.bytes, found.modified_ns, made_by)
        return self.error is None and mine == given


_SQL = {"str": "VARCHAR", "int": "BIGINT", "float": "DOUBLE", "list[str]": "VARCHAR[]"}
COLUMNS = {field.name: _SQL[str(field.type).removesuffix(" | None")] for field in fields(Row)}


def finite(value: float | None) -> float | None:
    """Returns the number, None for NaN and infinity: a table is sorted by it."""
    return None if value is None or not math.isfinite(value) else float(value)
