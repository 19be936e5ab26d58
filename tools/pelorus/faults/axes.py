# SPDX-License-Identifier: MIT
"""Detects twists in other body axes than the extrinsic's.

Points that are carried along by the twists' motion land far from their tracks, and much nearer when
the extrinsic's body axes are permuted or turned. All 24 right-handed choices compete, so no
convention is assumed. Remedy: T_CB diag(F, 1).
"""

from __future__ import annotations

import numpy as np

from pelorus.faults.duel import TOO_FEW, duel
from pelorus.faults.finding import Finding
from pelorus.faults.likelihood import with_ratio
from pelorus.io.recording import Recording
from pelorus.math.axes import name, turns
from pelorus.math.se3 import Poses
from pelorus.tracking.visual_motion import SeenPairs, seen_pairs
from pelorus.wire.layout import Floats

SUBJECT = "body axes"
LAG = 5
RATIO_MAX = 0.6  # least improvement: the error falls to this share of the given one
SHARE_MIN = 0.75  # share of the frames in which it must fall
Z_MIN = 3.0  # and with this significance


def mend(recording: Recording) -> tuple[Recording, Finding]:
    """Turns the body axes of the extrinsic if the data clearly show that it is needed."""
    seen = seen_pairs(recording.tracks, recording.header.camera, LAG)
    candidates = turns()
    errors = [_errors(recording, seen, F) for F in candidates]
    scores = [np.median(e[np.isfinite(e)]) if np.isfinite(e).any() else np.inf for e in errors]
    best = int(np.argmin(scores))
    result = duel(errors[0], errors[best], LAG)
    if not result.frames:
        return recording, Finding(SUBJECT, False, TOO_FEW, "left as given", is_conclusive=False)
    if best == 0 or not result.clearly_won(RATIO_MAX, SHARE_MIN, Z_MIN):
        return recording, Finding(SUBJECT, False, _quiet(scores), "nothing to mend")
    mended = _turned(recording.T_CB, candidates[best])
    evidence = (
        f"lag-{LAG} reprojection falls from {result.given:.1f} to {result.challenger:.1f} px with "
        f"the axes turned, in {100 * result.share:.0f} % of {result.frames} frames"
    )
    evidence = with_ratio(evidence, result.ratio)
    action = f"T_CB turned by {_text(candidates[best])}: body axes are now {name(mended.R)}"
    return recording.with_extrinsic(mended), Finding(SUBJECT, True, evidence, action)


def _turned(T_CB: Poses, F: Floats) -> Poses:
    return Poses(T_CB.R @ F, T_CB.p)


def _errors(recording: Recording, seen: SeenPairs, F: Floats) -> Floats:
    camera = recording.header.camera
    motion = recording.with_extrinsic(_turned(recording.T_CB, F)).camera_motion(LAG)
    return seen.median_by_frame(seen.reproject(camera, motion))


def _quiet(scores: list[float]) -> str:
    rival = min(scores[1:])
    return (
        f"lag-{LAG} reprojection is {scores[0]:.1f} px as given, "
        f"{rival:.1f} px with the best other axes"
    )


def _text(F: Floats) -> str:
    if np.count_nonzero(F - np.diag(np.diag(F))) == 0:
        return f"diag({', '.join(f'{x:.0f}' for x in np.diag(F))})"
    return str(F.astype(int).tolist())
