# SPDX-License-Identifier: MIT
"""A comparison as JSON: what `pelorus compare --json` prints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pelorus.flight.difference import Difference
from pelorus.flight.judge import Judgement, of_this_version, verdict_of
from pelorus.flight.log import NOWHERE, RobotLog
from pelorus.wire.frames import Config


def of(log: RobotLog, judgements: Sequence[Judgement]) -> dict[str, Any]:
    """Returns all that `compare` reports; a part is one life of the robot."""
    return {
        "log": str(log.path),
        "verdict": verdict_of(judgements).name.lower(),
        "frames": sum(len(one.part.frames) for one in judgements),
        "same": sum(one.same for one in judgements),
        "remarks": log.remarks,
        "parts": [_part(one) for one in judgements],
    }


def _part(found: Judgement) -> dict[str, Any]:
    part = found.part
    differences = [asdict(one.sizes) for one in found.differences]
    return {
        "verdict": found.verdict.name.lower(),
        "why": found.why or None,
        "first_frame": part.frames[0].number,
        "last_frame": part.frames[-1].number,
        "answered": len(part.answered),
        "same": found.same,
        "refused": sum(frame.unread for frame in part.frames),
        "left_out": [frame.number for frame in found.left_out],
        "losses": [
            {"frame": None if loss.at == NOWHERE else loss.at, "what": loss.words}
            for loss in part.losses
        ],
        "robot": _build(part.config),
        "desk": _build(found.desk),
        "first": None if found.first is None else _difference(found.first),
        "largest": {name: max(sizes[name] for sizes in differences) for name in differences[0]}
        if differences
        else None,
    }


def _build(build: Config | None) -> dict[str, Any] | None:
    if build is None:
        return None
    return {
        "fingerprint": build.build_fingerprint,
        "this_version": of_this_version(build),
        "landmarks": build.max_landmarks,
        "observations": build.max_observations,
        "real_bytes": build.real_bytes,
    }


def _difference(found: Difference) -> dict[str, Any]:
    robot = found.robot
    return {
        "frame": robot.number,
        "t_ns": robot.stereo.t_ns,
        "pose": found.pose,
        "report": {
            name: {"desk": desk, "robot": own} for name, (desk, own) in found.report.items()
        },
        "sizes": asdict(found.sizes),
        "said": robot.words,
    }
