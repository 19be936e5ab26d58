# SPDX-License-Identifier: MIT
"""All examinations, in the order in which they build on each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pelorus.faults import axes, lever, stale
from pelorus.faults.agreement import Agreement
from pelorus.faults.amounts import PLACE_TOLD_M
from pelorus.faults.fault import UNTOLD, Fault
from pelorus.faults.finding import Finding
from pelorus.faults.geometry import Judged
from pelorus.faults.named import judged
from pelorus.io.recording import Recording

NOTHING_LASTS = "ids-new"
AGREES = "camera and body"
CANNOT = "what is off by less than four times as much cannot be seen in this drive"
BEHIND = "before that is mended this drive cannot tell scale, clock and the camera's place"
SCALE_TOLD = 0.02  # sigma of the scale above which a drive shows little of it


def mend(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Finds and mends what the recording's own data show to be wrong.

    Tracks come first, for the others measure with them; axes come before the lever, which uses the
    body's displacement by the twists.
    """
    findings = []
    for examine in (stale.mend, axes.mend, lever.mend):
        recording, finding = examine(recording)
        findings.append(finding)
    return recording, findings


def held_to_fit(
    given: Recording, mended: Recording, findings: Sequence[Finding]
) -> tuple[Recording, list[Finding]]:
    """Returns the mended recording if all fits with it, else the given one; names the other faults.

    A changed extrinsic is kept only so.
    """
    found = judged(mended)
    if mended.tracks is not given.tracks and any(
        fault.name == NOTHING_LASTS for fault in found.faults
    ):
        # frozen pictures, not single stale tracks
        mended = replace(mended, tracks=given.tracks)
        findings = [_taken_back(finding, found.faults[0], stale.SUBJECT) for finding in findings]
        found = judged(mended)
    changed = mended.header.R_CB is not given.header.R_CB
    changed |= mended.header.t_CB_m is not given.header.t_CB_m
    wrong = [fault for fault in found.faults if fault.stops]
    if changed and wrong:
        findings = [_taken_back(f, wrong[0], axes.SUBJECT, lever.SUBJECT) for f in findings]
        mended = mended.with_extrinsic(given.T_CB)
        found = judged(mended)
    return mended, [*findings, *_known(found), *(_as_finding(fault) for fault in found.faults)]


def _known(found: Judged) -> Iterator[Finding]:
    """Yields how well the drive shows what was examined: silence is no promise."""
    if found.agreed is not None:
        is_enough = found.agreed.scale_sigma < SCALE_TOLD
        yield Finding(AGREES, False, known_words(found.agreed), CANNOT, is_conclusive=is_enough)
    elif any(fault.stops for fault in found.faults):
        yield Finding(AGREES, False, BEHIND, "nothing was changed", is_conclusive=False)


def known_words(agreed: Agreement) -> str:
    """Returns in words what the drive shows of camera and body, and how well."""
    place_m = np.sqrt(np.diagonal(agreed.lever_covariance))
    place = f"to {place_m.max():.2f} m"
    if place_m.max() > PLACE_TOLD_M:
        place = f"not along every axis (to {place_m.min():.2f} m along the best)"
    clock = "the clock cannot be told"
    if np.isfinite(agreed.offset_sigma_s):
        clock = f"clock {agreed.offset_s * 1e3:+.0f} +- {agreed.offset_sigma_s * 1e3:.0f} ms"
    return (
        f"scale of the way {agreed.scale:.3f} +- {agreed.scale_sigma:.3f}, {clock}, the camera's "
        f"place {place}"
    )


def _taken_back(finding: Finding, because: Fault, *subjects: str) -> Finding:
    if finding.subject not in subjects or not finding.found:
        return finding
    action = f"left as given: even then it would not fit ({because.words})"
    return replace(finding, is_conclusive=False, found=False, action=action)


def _as_finding(fault: Fault) -> Finding:
    if fault.name == UNTOLD:
        return Finding(AGREES, False, fault.sentence, "nothing was changed", is_conclusive=False)
    action = "nothing was changed; the filter can live with it, and pelorus check tells more"
    if fault.grave:
        action = "nothing was changed: mend it where the data or the calibration come from"
    return Finding(fault.name, True, fault.sentence, action)
