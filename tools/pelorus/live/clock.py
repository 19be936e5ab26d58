# SPDX-License-Identifier: MIT
"""Another clock beside this machine's: told apart by what comes with a stamp of the other one."""

from __future__ import annotations

from dataclasses import dataclass

DRIFT = 1e-4  # by so much two cheap clocks may differ in rate


@dataclass
class OtherClock:
    """What comes last is late by the least time of all: the largest difference is the best. It is
    let go slowly, for clocks drift.
    """

    _ahead_ns: float | None = None
    _at_ns: int = 0

    def heard(self, stamp_ns: int, host_ns: int) -> None:
        """Something with the other clock's stamp has come at this time of the host."""
        ahead = float(stamp_ns - host_ns)
        if self._ahead_ns is not None:
            ahead = max(ahead, self._ahead_ns - DRIFT * max(host_ns - self._at_ns, 0))
        self._ahead_ns, self._at_ns = ahead, host_ns

    def at(self, host_ns: int) -> int | None:
        """Returns what the other clock shows at a time of the host; None if nothing is known."""
        return None if self._ahead_ns is None else host_ns + round(self._ahead_ns)

    def to_host(self, stamp_ns: int) -> int:
        """Returns the time of the host; something must have been heard."""
        assert self._ahead_ns is not None
        return stamp_ns - round(self._ahead_ns)
