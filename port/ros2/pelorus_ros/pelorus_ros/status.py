# SPDX-License-Identifier: MIT
"""What is wrong with the node's set-up and inputs, and what to do, for diagnostic_msgs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pelorus.online.diagnosis import Level, Status


def of_setup(blocked: Mapping[str, str], waits_for: str) -> Status:
    """Returns whether the drive can be estimated at all."""
    if blocked:
        words = "; ".join(blocked.values())
        return Status("setup", Level.ERROR, words, "correct it, then call the service reset")
    if waits_for:
        waits = f"waits {waits_for}" if waits_for.startswith("for") else waits_for
        return Status("setup", Level.ERROR, waits, "see the message: what lacks stands in it")
    return Status("setup", Level.OK, "calibration and mounting are known")


def of_inputs(
    topics: Sequence[str], fresh: Counter[str], ever: Counter[str], faults: Mapping[str, str]
) -> list[Status]:
    """Returns which topics are silent, and which messages could not be used."""
    rates = {topic: str(fresh[topic]) for topic in topics}
    silent = [topic for topic in topics if not fresh[topic]]
    found = [Status("inputs", Level.OK, "all come", values=rates)]
    if silent:
        never = not any(ever[topic] for topic in silent)
        words = f"nothing came on {', '.join(silent)} ({'never' if never else 'any more'})"
        do = "is the driver alive, the name remapped, the QoS compatible? ros2 topic info -v"
        found = [Status("inputs", Level.ERROR, words, do, rates)]
    return found + [
        Status(topic, Level.ERROR, words, "the message was left out")
        for topic, words in faults.items()
    ]
