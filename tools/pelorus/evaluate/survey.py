# SPDX-License-Identifier: MIT
"""Counts the content of a recording: the numbers behind `pelorus info`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.evaluate import inertial_survey
from pelorus.evaluate.health import TimeLine, time_line
from pelorus.evaluate.inertial_survey import ImuSurvey
from pelorus.io import arrivals
from pelorus.io.small_sensors import name_of
from pelorus.math.inertial import GRAVITY_MPS2
from pelorus.wire import framing
from pelorus.wire.calibrated import Calibrated, last_calibrated
from pelorus.wire.frames import (
    Config,
    End,
    Header,
    Imu,
    Kind,
    Landmark,
    Message,
    Reading,
    Stereo,
    Text,
)
from pelorus.wire.framing import Counts, Received
from pelorus.wire.schema import HEALTHS
from pelorus.wire.settings import describe

SAME_MOST = 10  # identical successive readings that the filter allows
GRAVITY_OFF_MPS2 = 1.0
GAP_RATIO = 1.5  # an interval that exceeds the median one by this ratio is a gap
DAMAGE = ("damaged", "missing", "malformed", "unknown", "too_long")  # of Counts
DATA = (Kind.TWIST, Kind.IMU, Kind.STEREO, Kind.TRUTH, Kind.POSE)


class Gap(NamedTuple):
    """A pause in a stream."""

    after_ns: int
    length_ns: int


@dataclass(frozen=True)
class Stream:
    """The frames of one kind over time."""

    count: int
    first_ns: int
    last_ns: int
    rate_hz: float  # from the median interval
    gaps: list[Gap]
    steps_back: int  # times that do not ascend


@dataclass(frozen=True)
class TrackSurvey:
    """Observations of all STEREO frames."""

    observations: int
    per_frame: tuple[int, int, int]  # least, median, most
    landmarks: int
    frames_per_landmark: float  # median
    no_disparity: int  # uL <= uR: behind infinity


@dataclass(frozen=True)
class SensorSurvey:
    """The READINGs of one sensor."""

    stream: Stream
    axes: int  # bits: all that were measured at any time
    sigma: tuple[float, ...]  # median of each measured number
    ranges: tuple[tuple[float, float], ...]  # least and most of each
    places_B_m: tuple[tuple[float, ...], ...]  # where on the body they sit
    zero_s: float  # for how long all measured numbers are 0


@dataclass(frozen=True)
class Survey:
    """Everything that `info` shows."""

    path: Path
    counts: Counts
    header: Header | None
    configs: list[Config]
    landmarks: dict[str, int]  # by role
    texts: list[Text]
    streams: dict[Kind, Stream]
    sensors: dict[str, SensorSurvey]
    calibrated: Calibrated | None  # a filter's last estimate
    imu: ImuSurvey | None
    tracks: TrackSurvey | None
    end: End | None
    health: TimeLine | None = None  # of a result
    remarks: list[str] = field(default_factory=list)

    @property
    def origin_ns(self) -> int:
        """Returns the first time of any stream, which is time 0 in the output."""
        sensors = (sensor.stream for sensor in self.sensors.values())
        streams = (*self.streams.values(), *sensors)
        return min((stream.first_ns for stream in streams), default=0)

    @property
    def useful(self) -> bool:
        """Returns whether there is a header, and data to which it applies."""
        return self.header is not None and bool(self.streams or self.sensors)


def survey(path: Path) -> Survey:
    """Reads a recording, damaged or not; raises PelorusError where not one frame can be read."""
    received, counts = framing.read_file(path)
    messages = [frame.message for frame in received]
    header = next((m for m in messages if isinstance(m, Header)), None)
    end = next((m for m in reversed(messages) if isinstance(m, End)), None)
    streams = {
        kind: _stream(_times([m for m in messages if m.kind == kind]))
        for kind in DATA
        if counts.frames[kind]
    }
    imus = [m for m in messages if isinstance(m, Imu)]
    stereos = [m for m in messages if isinstance(m, Stereo)]
    roles = [m.role.name.lower() for m in messages if isinstance(m, Landmark)]
    found = Survey(
        path=path,
        counts=counts,
        header=header,
        configs=[m for m in messages if isinstance(m, Config)],
        landmarks={role: roles.count(role) for role in dict.fromkeys(roles)},
        texts=[m for m in messages if isinstance(m, Text)],
        streams=streams,
        sensors=_sensors([m for m in messages if isinstance(m, Reading)]),
        calibrated=last_calibrated(messages),
        imu=inertial_survey.survey(inertial_survey.readings_of(imus)) if imus else None,
        tracks=_tracks(stereos) if stereos else None,
        end=end,
        health=time_line(messages),
    )
    found.remarks.extend(_remarks(found, received))
    return found


def _sensors(readings: list[Reading]) -> dict[str, SensorSurvey]:
    """Returns the sensors by name, in the order of their numbers."""
    found = {}
    for number in sorted({m.sensor for m in readings}):
        own = [m for m in readings if m.sensor == number]
        has = np.array([[m.axes >> k & 1 for k in range(3)] for m in own], bool)
        sigma, value = np.array([m.sigma for m in own]), np.array([m.value for m in own])
        measured = [(value[has[:, k], k], sigma[has[:, k], k]) for k in range(3) if has[:, k].any()]
        stream = _stream(_times(own), ties=True)
        zero = int(np.sum(~np.any(has & (value != 0), axis=1)))
        found[name_of(number)] = SensorSurvey(
            stream,
            int(np.bitwise_or.reduce([m.axes for m in own])),
            tuple(float(np.median(sigmas)) for _, sigmas in measured),
            tuple((float(values.min()), float(values.max())) for values, _ in measured),
            tuple(sorted({tuple(m.at_B_m.tolist()) for m in own})),
            zero / len(own) * (stream.last_ns - stream.first_ns) * 1e-9,
        )
    return found


def _times(messages: Sequence[Message]) -> list[int]:
    """Returns the time of each message, or of each reading of an IMU."""
    return [
        int(t)
        for m in messages
        for t in (m.times_ns if isinstance(m, Imu) else [m.t_ns])  # type: ignore[attr-defined]
    ]


def _stream(exact: Sequence[int], ties: bool = False) -> Stream:
    """Returns a stream's figures; with `ties` several messages may have one time."""
    steps = np.diff(np.array(exact, np.float64))
    ahead = steps[steps > 0]
    usual = float(np.median(ahead)) if len(ahead) else 0.0
    late = np.nonzero((steps > GAP_RATIO * usual) & (steps > 0))[0]
    return Stream(
        count=len(exact),
        first_ns=exact[0],
        last_ns=exact[-1],
        rate_hz=1e9 / usual if usual else 0.0,
        gaps=[Gap(exact[k], exact[k + 1] - exact[k]) for k in late.tolist()],
        steps_back=int(np.sum(steps < 0 if ties else steps <= 0)),
    )


def _tracks(stereos: list[Stereo]) -> TrackSurvey:
    per_frame = np.array([len(m.ids) for m in stereos])
    ids = np.concatenate([m.ids for m in stereos])
    pixels = np.concatenate([m.pixels for m in stereos])
    _, seen = np.unique(ids, return_counts=True)
    with np.errstate(invalid="ignore"):
        no_disparity = int(np.sum(~(pixels[:, 0] > pixels[:, 2])))
    return TrackSurvey(
        observations=len(ids),
        per_frame=(int(per_frame.min()), int(np.median(per_frame)), int(per_frame.max())),
        landmarks=len(seen),
        frames_per_landmark=float(np.median(seen)) if len(seen) else 0.0,
        no_disparity=no_disparity,
    )


def _remarks(found: Survey, received: list[Received]) -> list[str]:
    """Returns remarks for a reader of the recording."""
    said = []
    if found.header is None:
        said.append("there is no HEADER: without the calibration nothing can be replayed")
    elif not isinstance(received[0].message, Header):
        said.append("HEADER is not the first frame")
    if found.header is not None and not found.useful:
        said.append(
            "there are no data: neither TWIST nor IMU nor STEREO nor TRUTH nor READING nor POSE"
        )
    if found.end is None:
        said.append("there is no END: the recording was cut short")
    else:
        said.extend(_end_differences(found.end, found.counts))
    for kind, stream in found.streams.items():
        if stream.steps_back:
            said.append(f"{kind.name}: time does not ascend {stream.steps_back} times")
    said.extend(late.words for late in arrivals.late_ones([r.message for r in received]))
    if found.imu is not None:
        said.extend(_imu_remarks(found.imu))
    for name, sensor in found.sensors.items():
        if sensor.stream.steps_back:
            said.append(f"READING {name}: time does not ascend {sensor.stream.steps_back} times")
    return said


def _imu_remarks(imu: ImuSurvey) -> list[str]:
    said = []
    if imu.not_finite:
        said.append(f"IMU: {imu.not_finite} readings are not finite")
    if imu.longest_same >= SAME_MOST:
        said.append(f"IMU: {imu.longest_same} successive readings have the same numbers: frozen?")
    if imu.still is not None and abs(imu.still.force_mps2 - GRAVITY_MPS2) > GRAVITY_OFF_MPS2:
        said.append(
            f"IMU: at rest it feels {imu.still.force_mps2:.3g} m/s^2, where gravity's "
            f"{GRAVITY_MPS2:g} are expected"
        )
    return said


def _end_differences(end: End, counts: Counts) -> list[str]:
    told = {
        Kind.TWIST: end.twists,
        Kind.STEREO: end.stereos,
        Kind.TRUTH: end.truths,
        Kind.LANDMARK: end.landmarks,
        Kind.READING: end.readings,
        Kind.IMU: end.imus,
    }
    return [
        f"END tells of {expected} {kind.name} frames, {counts.frames[kind]} can be read"
        for kind, expected in told.items()
        if expected != counts.frames[kind]
    ]


def require_useful(found: Survey) -> None:
    """Raises PelorusError where nothing in the recording can be used."""
    if not found.useful:
        raise PelorusError(f"{found.path}: nothing useful in it: {'; '.join(found.remarks)}")


# --- as JSON --------------------------------------------------------------------------------------


def survey_json(found: Survey) -> dict[str, Any]:
    """Returns everything that `info` shows; null where there is nothing. Times are in s from
    `time_0_ns` on.
    """
    origin = found.origin_ns
    counts = found.counts
    config = found.configs[-1] if found.configs else None
    return {
        "recording": str(found.path),
        "bytes": counts.bytes,
        "useful": found.useful,
        "time_0_ns": origin,
        "header": None if found.header is None else _header_json(found.header),
        "settings": None
        if config is None
        else dict(describe(*row) for row in config.settings.items()),
        "settings_in_force": bool(config and config.build_fingerprint),
        "frames": {kind.name: count for kind, count in counts.frames.items()},
        "landmarks": found.landmarks,
        "streams": {
            kind.name: _stream_json(stream, origin) for kind, stream in found.streams.items()
        },
        "sensors": {
            name: _stream_json(sensor.stream, origin)
            | {key: value for key, value in vars(sensor).items() if key != "stream"}
            for name, sensor in found.sensors.items()
        },
        "calibrated": found.calibrated.figures if found.calibrated else None,
        "imu": None if found.imu is None else _imu_json(found.imu, origin),
        "tracks": None if found.tracks is None else asdict(found.tracks),
        "health": None if found.health is None else _health_json(found.health, origin),
        "texts": [{"severity": text.severity, "text": text.text} for text in found.texts],
        "remarks": found.remarks,
        "damage": {
            **{name: getattr(counts, name) for name in DAMAGE},
            "faults": [fault._asdict() for fault in counts.faults],
        },
    }


def _header_json(header: Header) -> dict[str, Any]:
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


def _stream_json(stream: Stream, origin_ns: int) -> dict[str, Any]:
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


def _imu_json(imu: ImuSurvey, origin_ns: int) -> dict[str, Any]:
    found = asdict(imu)
    if imu.still is not None:
        still = found["still"]
        still["from_s"] = _seconds(still.pop("from_ns") - origin_ns)
        still["to_s"] = _seconds(still.pop("to_ns") - origin_ns)
    return found


def _health_json(health: TimeLine, origin_ns: int) -> dict[str, Any]:
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
