# SPDX-License-Identifier: MIT
"""Recordings that keep their pictures: eyes follow the points when they are replayed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pelorus.converters import streams
from pelorus.converters.streams import Pictures, Streams
from pelorus.errors import PelorusError
from pelorus.faults.finding import Finding
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.rig.lens import Lens
from pelorus.rig.rig import Rig
from pelorus.tracker import COEFFICIENTS_MAX, MODELS, Tracker
from pelorus.tracking import images
from pelorus.wire.frames import Camera, Header
from pelorus.wire.image import PicturesOf, RigMessage, TimedPair
from pelorus.wire.layout import Floats


def recording(found: Streams) -> tuple[Recording, list[Finding]]:
    """Returns a recording with the source's pictures in the place of tracks, and findings."""
    frames, calibrated = found.frames, found.calibrated
    if not isinstance(frames, Pictures):
        raise PelorusError("--keep-pictures: the source has tracks, and no pictures")
    first = next(frames.read())[0]
    height, width = first.shape
    header, rig, message = calibrated.header, calibrated.rig, None
    images.require_size(frames.where[0], first.shape, calibrated.sizes)
    t_ns = frames.t_ns
    if rig is not None:
        t_ns = rig.on_body_clock(t_ns)
        message, header = _cameras(rig.of_size(width, height), header)
    header = replace(header, image_width_px=width, image_height_px=height)

    def pairs() -> Iterator[TimedPair]:
        for t, (left, right) in zip(t_ns.tolist(), frames.read(), strict=True):
            for where, picture in zip(frames.where, (left, right), strict=True):
                images.require_alike(where, picture, first)
            yield TimedPair(t, t, left, right)

    truth = None
    if found.truth is not None:
        truth = streams.at_frames(found.truth, t_ns, found.motion)
    made, findings = streams.of_drive(header, found, t_ns, Tracks.none(), truth)
    shown = PicturesOf(t_ns, width, height, pairs, message)
    return replace(made, frame_t_ns=t_ns[:0], pictures=shown), findings


def _cameras(rig: Rig, header: Header) -> tuple[RigMessage, Header]:
    """Returns the RIG, and the HEADER of the virtual camera in which eyes tell what they see."""
    if rig.T_LB is None:
        raise ForeignFileError(
            rig.path,
            "does not say where the camera sits on the body; --extrinsic FILE is expected: JSON "
            "with R_CB and t_CB_m",
        )
    seen = Tracker(rig).calibration(rig.T_LB.R, rig.T_LB.p)
    camera = Camera(seen.fx_px, seen.fy_px, seen.cx_px, seen.cy_px, seen.baseline_m)
    left, right = rig.left, rig.right
    message = RigMessage(
        left.width_px, left.height_px,
        MODELS[left.model], *left.intrinsics, MODELS[right.model], *right.intrinsics,
        _numbers(left), _numbers(right), rig.T_RL.R, rig.T_RL.p,
    )  # fmt: skip
    R, t = np.asarray(seen.R_CB), np.asarray(seen.t_CB_m)
    return message, replace(header, camera=camera, R_CB=R, t_CB_m=t)


def _numbers(lens: Lens) -> Floats:
    return np.array((*lens.coefficients, *([0.0] * COEFFICIENTS_MAX))[:COEFFICIENTS_MAX])
