# SPDX-License-Identifier: MIT
"""How few slots suffice for a recording's landmarks: time grows with the square of their number.

The landmark unseen for longest is evicted first. One that is never seen again says nothing about
the others, but its rows of P cost as much as theirs. Without it model world finds the same, bit by
bit; body takes part of its linearisation from all landmarks (docs/TESTING.md), and costs an
observation differ by 4e-4 to 5e-3.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import takewhile

from pelorus.check.options import Settings
from pelorus.wire.frames import Config, Kind, Message, Stereo
from pelorus.wire.settings import IDS

USUAL, FEW = 100, 30  # of a replay to which nobody gives a number; for a coarse search
SLOTS = "slots"


class Slots:
    """The slots of a recording's replays."""

    def __init__(self, messages: Sequence[Message]) -> None:
        id = IDS[SLOTS]
        asked = [m.settings[id] for m in messages if isinstance(m, Config) and id in m.settings]
        self._own = int(asked[-1]) if asked else USUAL
        # Known landmarks take slots, too, and are not among the tracks.
        by_map = any(m.kind == Kind.LANDMARK for m in messages)
        self._needed = self._own if by_map else needed(messages, self._own)

    def sparing(self, settings: Settings) -> dict[str, str]:
        """Returns the settings with as many slots as are of use, and no more than they give."""
        given = int(float(settings.get(SLOTS, self._own)))
        if settings.get("mode", "slam") != "slam" or given <= self._needed:
            return dict(settings)
        return {**settings, SLOTS: str(self._needed)}


def fewer(given: Settings) -> dict[str, str]:
    """Returns the setting for a coarse search: a third of the time."""
    return {SLOTS: str(min(int(float(given.get(SLOTS, USUAL))), FEW))}


def needed(messages: Sequence[Message], most: int) -> int:
    """Returns the fewest slots, up to `most`, that keep every landmark which is seen again."""
    found, last_seen = 1, dict[int, int]()  # frame by id, in the order of the last sightings
    frames = (m.ids.tolist() for m in messages if isinstance(m, Stereo))
    for frame, ids in enumerate(frames):
        since = min((last_seen.get(id, frame) for id in ids), default=frame)
        newest_first = reversed(last_seen.values())
        found = max(found, len(ids), len(list(takewhile(since.__le__, newest_first))))
        if found >= most:
            return most
        for id in ids:
            last_seen.pop(id, None)
            last_seen[id] = frame
    return found
