# SPDX-License-Identifier: MIT
"""A survey as JSON: what `pelorus info --json` prints. Times are in s from `time_0_ns` on."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from pelorus.evaluate.health import TimeLine
from pelorus.evaluate.inertial_survey import ImuSurvey
from pelorus.evaluate.survey import Stream, Survey
from pelorus.wire.frames import Header
from pelorus.wire.schema import HEALTHS
from pelorus.wire.settings import describe


def of(found: Survey) -> dict[str, Any]:
    """Returns everything that `info` shows; null where there is nothing."""
    origin = found.origin_ns
    counts = found.counts
    config = found.configs[-1] if found.configs else None
    return {
        "recording": str(found.path),
        "bytes": counts.bytes,
        "useful": found.useful,
        "time_0_ns": origin,
        "header": None if found.header is None else _header(found.header),
        "settings": None
        if config is None
        else dict(describe(*row) for row in config.settings.items()),
        "settings_in_force": bool(config and config.build_fingerprint),
        "frames": {kind.name: count for kind, count in counts.frames.items()},
        "landmarks": found.landmarks,
        "streams": {kind.name: _stream(stream, origin) for kind, stream in found.streams.items()},
        "sensors": {
            name: _stream(sensor.stream, origin)
            | {
                "axes": sensor.axes,
                "sigma": sensor.sigma,
                "ranges": sensor.ranges,
                "places_B_m": sensor.places_B_m,
                "zero_s": sensor.zero_s,
            }
            for name, sensor in found.sensors.items()
        },
        "calibrated": found.calibrated.figures if found.calibrated else None,
        "imu": None if found.imu is None else _imu(found.imu, origin),
        "tracks": None if found.tracks is None else asdict(found.tracks),
        "health": None if found.health is None else _health(found.health, origin),
        "texts": [{"severity": text.severity, "text": text.text} for text in found.texts],
        "remarks": found.remarks,
        "damage": {
            "damaged": counts.damaged,
            "missing": counts.missing,
            "malformed": counts.malformed,
            "unknown": counts.unknown,
            "too_long": counts.too_long,
            "faults": [fault._asdict() for fault in counts.faults],
        },
    }


def _header(header: Header) -> dict[str, Any]:
    return {
        "version": [header.version_major, header.version_minor],
        "name": header.name,
        "body_axes": header.body_axes.name.lower().replace("_", "-"),
        "process": header.process.name.lower(),
        "twist_timing": header.twist_timing.name.lower(),
        "image_px": [header.image_width_px, header.image_height_px],
        **{name: _number(value) for name, value in vars(header.camera).items()},
        "R_CB": [[_number(x) for x in row] for row in np.asarray(header.R_CB).tolist()],
        "t_CB_m": [_number(x) for x in np.asarray(header.t_CB_m).tolist()],
        "suggests": {name: value for name, value in vars(header.noise).items() if value >= 0},
    }


def _stream(stream: Stream, origin_ns: int) -> dict[str, Any]:
    return {
        "count": stream.count,
        "from_s": _seconds(stream.first_ns - origin_ns),
        "to_s": _seconds(stream.last_ns - origin_ns),
        "rate_hz": stream.rate_hz,
        "steps_back": stream.steps_back,
        "gaps": [
            {"after_s": _seconds(gap.after_ns - origin_ns), "length_s": _seconds(gap.length_ns)}
            for gap in stream.gaps
        ],
    }


def _imu(imu: ImuSurvey, origin_ns: int) -> dict[str, Any]:
    found = asdict(imu)
    if imu.still is not None:
        still = found["still"]
        still["from_s"] = _seconds(still.pop("from_ns") - origin_ns)
        still["to_s"] = _seconds(still.pop("to_ns") - origin_ns)
    return found


def _health(health: TimeLine, origin_ns: int) -> dict[str, Any]:
    return {
        "frames": health.frames,
        "before_start": health.before_start,
        **health.by_health,
        "spells": [
            {
                "health": HEALTHS[spell.health],
                "from_s": _seconds(spell.from_ns - origin_ns),
                "to_s": _seconds(spell.to_ns - origin_ns),
                "frames": spell.frames,
                "why": spell.why,
            }
            for spell in health.spells
        ],
    }


def _seconds(ns: int) -> float:
    return round(ns * 1e-9, 9)


def _number(value: float) -> float | None:
    """Returns null for NaN and infinity, which JSON does not have."""
    return value if np.isfinite(value) else None
