# SPDX-License-Identifier: MIT
"""All examinations in the order in which they build on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pelorus.faults import axes, lever, stale
from pelorus.faults.fault import UNTOLD, Fault
from pelorus.faults.finding import Finding
from pelorus.faults.named import faults_in
from pelorus.recording import Recording

NOTHING_LASTS = "ids-new"


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


def held_to_fit(
    given: Recording, mended: Recording, findings: Sequence[Finding]
) -> tuple[Recording, list[Finding]]:
    """The absolute test. An extrinsic that was changed stays so only if all fits with it; and what
    is wrong besides is told by name.
    """
    named = faults_in(mended)
    if mended.tracks is not given.tracks and any(fault.name == NOTHING_LASTS for fault in named):
        mended = replace(
            mended, tracks=given.tracks
        )  # pictures that stand still, not single tracks
        findings = [_taken_back(finding, named[0], stale.SUBJECT) for finding in findings]
        named = faults_in(mended)
    changed = mended.header.R_CB is not given.header.R_CB
    changed |= mended.header.t_CB_m is not given.header.t_CB_m
    wrong = [fault for fault in named if fault.stops]
    if changed and wrong:
        findings = [_taken_back(f, wrong[0], axes.SUBJECT, lever.SUBJECT) for f in findings]
        mended = mended.with_extrinsic(given.T_CB)
        named = faults_in(mended)
    return mended, [*findings, *(_told(fault) for fault in named if fault.name != UNTOLD)]


def _taken_back(finding: Finding, because: Fault, *subjects: str) -> Finding:
    if finding.subject not in subjects or not finding.found:
        return finding
    action = f"left as given: even then it would not fit ({because.words})"
    return replace(finding, told=False, found=False, action=action)


def _told(fault: Fault) -> Finding:
    action = "nothing was changed; the filter can live with it, and pelorus check tells more"
    if fault.grave:
        action = "nothing was changed: mend it where the data or the calibration come from"
    return Finding(fault.name, True, fault.words, action)
