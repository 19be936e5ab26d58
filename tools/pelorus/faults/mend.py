# SPDX-License-Identifier: MIT
"""Mends what a recording's own data show to be wrong, and names the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pelorus.faults import stale
from pelorus.faults.agreement import Agreement
from pelorus.faults.amounts import PLACE_TOLD_M
from pelorus.faults.fault import UNTOLD, Fault
from pelorus.faults.finding import Finding
from pelorus.faults.geometry import Judged
from pelorus.faults.named import judged
from pelorus.io.recording import Recording
from pelorus.math.axes import name
from pelorus.math.se3 import Poses
from pelorus.wire.layout import Floats

NOTHING_LASTS = "ids-new"
AGREES = "camera and body"
CANNOT = "what is off by less than four times as much cannot be seen in this drive"
BEHIND = "before that is mended this drive cannot tell scale, clock and the camera's place"
SCALE_TOLD = 0.02  # sigma of the scale above which a drive shows little of it
REMEDIES = 2  # of the extrinsic: its axes, and then its place, which the turns tell


@dataclass(frozen=True)
class Mended:
    """A recording, what was changed in it or left, and what is still to be said of it."""

    recording: Recording
    changes: list[Finding]
    told: list[Finding]


def mend(given: Recording) -> Mended:
    """Mends stale tracks, and an extrinsic of other axes or of another convention.

    Tracks come first, for all else measures with them; they stay split unless then no id lasts. An
    extrinsic is changed only if the recording then has no fault that stops.
    """
    recording, of_tracks = stale.mend(given)
    found = judged(recording)
    if of_tracks.found and found.faults and found.faults[0].name == NOTHING_LASTS:
        # frozen pictures, not single stale tracks
        of_tracks = _left(of_tracks, found.faults[0])
        recording, found = given, judged(given)
    fits, now, remedies = recording, found, list[Finding]()
    while len(remedies) < REMEDIES:
        fault = next((fault for fault in now.faults if fault.extrinsic is not None), None)
        if fault is None or fault.extrinsic is None:
            break
        action = _changed(fits.T_CB, fault.extrinsic)
        remedies.append(Finding(fault.name, True, fault.sentence, action))
        fits = fits.with_extrinsic(fault.extrinsic)
        now = judged(fits)
    wrong = [fault for fault in now.faults if fault.stops]
    if remedies and wrong:
        remedies = [_left(finding, wrong[0]) for finding in remedies]
    elif remedies:
        recording, found = fits, now
    return Mended(recording, [of_tracks, *remedies], _told(found))


def findings_of(recording: Recording) -> list[Finding]:
    """Returns the faults of a recording that is not to be changed, and what it cannot show."""
    return _told(judged(recording))


def _left(finding: Finding, because: Fault) -> Finding:
    """Returns the finding of what would not fit even if it were mended."""
    action = f"left as given: even then it would not fit ({because.words})"
    return replace(finding, is_conclusive=False, found=False, action=action)


def _changed(given: Poses, other: Poses) -> str:
    """Returns in words what is replaced in the extrinsic."""
    if np.array_equal(given.R, other.R):
        return f"t_CB {_metres(given.p)} replaced by {_metres(other.p)}"
    return f"R_CB turned: the body's axes are now {name(other.R)}"


def _metres(p: Floats) -> str:
    return "(" + ", ".join(f"{x:.3f}" for x in p) + ") m"


def _told(found: Judged) -> list[Finding]:
    return [*_known(found), *(_as_finding(fault) for fault in found.faults)]


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


def _as_finding(fault: Fault) -> Finding:
    if fault.name == UNTOLD:
        return Finding(AGREES, False, fault.sentence, "nothing was changed", is_conclusive=False)
    action = "nothing was changed; the filter can live with it, and pelorus check tells more"
    if fault.grave:
        action = "nothing was changed: mend it where the data or the calibration come from"
    return Finding(fault.name, True, fault.sentence, action)
