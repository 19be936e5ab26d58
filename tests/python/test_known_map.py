# SPDX-License-Identifier: MIT
"""A map of an earlier result: what is taken, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pelorus.errors import PelorusError
from pelorus.io.known_map import known_map
from pelorus.wire.frames import UNKNOWN_VARIANCE, Camera, Header, Landmark, Message
from pelorus.wire.framing import Writer
from pelorus.wire.message import Role

SMALL = np.array([0.01, 0, 0, 0.01, 0, 0.01])


def landmark(id: int, role: Role, covariance: np.ndarray = SMALL) -> Landmark:
    return Landmark(id, np.array([id, 2.0, 3.0]), covariance, role)


def written(path: Path, *landmarks: Message) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        for message in (Header(Camera(400, 400, 320, 240, 0.1)), *landmarks):
            writer.write(message)
        writer.end()
    return path


def test_results_are_the_map_and_what_was_known_to_their_filter_is_not(tmp_path: Path) -> None:
    known, made = landmark(7, Role.KNOWN), landmark(7, Role.FINAL)
    gone, far = landmark(4, Role.EVICTED), landmark(9, Role.FINAL, UNKNOWN_VARIANCE * SMALL / 0.01)
    found = known_map(written(tmp_path / "map.plr", known, made, gone, far))
    assert [(one.id, one.role) for one in found] == [(4, Role.KNOWN), (7, Role.KNOWN)]
    assert [one.id for one in known_map(written(tmp_path / "known.plr", known))] == [7]


@pytest.mark.parametrize(
    ("landmarks", "says"),
    [
        ([], "it has no landmark of known place; give a result of pelorus-replay --out"),
        ([landmark(4, Role.EVICTED), landmark(4, Role.FINAL)], "landmark 4 stands twice"),
        ([landmark(4, Role.FINAL, 0 * SMALL)], "landmark 4: its position or covariance is none"),
    ],
)
def test_what_is_no_map_is_refused_with_the_reason(
    landmarks: list[Message], says: str, tmp_path: Path
) -> None:
    with pytest.raises(PelorusError, match=says):
        known_map(written(tmp_path / "map.plr", *landmarks))
