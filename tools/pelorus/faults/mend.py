# SPDX-License-Identifier: MIT
"""All examinations in the order in which they build on each other."""

from __future__ import annotations

from pelorus.faults import axes, lever, stale
from pelorus.faults.finding import Finding
from pelorus.recording import Recording


def mend(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Find and mend what the recording's own data give away.

    Tracks come first, for the others measure with them; axes before the lever, which takes the
    way of the camera from the twists.
    """
    findings = []
    for examine in (stale.mend, axes.mend, lever.mend):
        recording, finding = examine(recording)
        findings.append(finding)
    return recording, findings
