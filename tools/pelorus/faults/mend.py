# SPDX-License-Identifier: MIT
"""All examinations in the order in which they build on each other."""

from __future__ import annotations

from pelorus.faults import axes, lever, stale
from pelorus.faults.finding import Finding
from pelorus.recording import Recording

ORDER = (stale.mend, axes.mend, lever.mend)  # tracks first: the others measure with them


def mend(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Find and mend what the recording's own data give away."""
    findings = []
    for examine in ORDER:
        recording, finding = examine(recording)
        findings.append(finding)
    return recording, findings
