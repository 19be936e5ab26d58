# SPDX-License-Identifier: MIT
"""One replay and the likelihood of its observations, by which settings are compared.

Each REPORT has d2 = y^T S^-1 y and ln det S of all innovations that the frame used, as predicted
before the frame was seen. Their sum over a drive is -2 ln of the likelihood of the observations,
given the settings; smaller is better. An observation that the gate rejected counts as one that may
lie anywhere in the picture: otherwise the best settings would be those that reject everything.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.check.apart import Parts
from pelorus.check.contents import (
    Frames,
    first_frames,
    half,
    not_before,
    recording_of,
    scaled,
    shifted,
    within,
)
from pelorus.check.options import Settings, options_of
from pelorus.check.slots import Slots
from pelorus.errors import PelorusError
from pelorus.io.trajectory import POSE_SIZE
from pelorus.native.replay import stuffed_answers, threads
from pelorus.program.console import progress
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Message, Pose, Process, Stereo
from pelorus.wire.layout import Floats, unpack_symmetric
from pelorus.wire.schema import number

# While settings are compared the gate stands where an observation is as likely an outlier as an
# inlier. The usual gate cuts 1 % of the inliers, and so would favour sigmas that are too large.
GATE_D2 = "25"
DISPARITY_SPAN_PX = 100.0
BEGIN_NS = 1_000_000_000  # a recording may begin at zero; offsets must not lead below
OFFSET_MOST_S = 0.1
OFFSET, PART, LENGTH, SCALE = "@offset", "@part", "@frames", "@scale"
CAMERA_OFFSET = "camera-offset"
COUNTED = ("matched", "used", "gated", "innovation_rows")
SUMMED = (*COUNTED, "innovation_d2", "innovation_log_det")
CONTRADICTED = number("reason", "TWIST_CONTRADICTED")


@dataclass(frozen=True)
class Outcome:
    """The result of one replay. `cost` is the mean of -2 ln of an observation's likelihood."""

    cost: float
    matched: int
    used: int
    gated: int
    frames: int
    nis: float  # per degree of freedom: 1 is expected
    bias: Floats  # at the end, (b_v, b_w)
    bias_variance: Floats
    contradicted: float = 0.0  # share of the frames in which vision contradicts twists or IMU
    pose_log_det: float = -math.inf  # ln det of the last pose's covariance
    by_frame: Floats = field(
        default_factory=lambda: np.zeros(0)
    )  # -2 ln of each frame's likelihood

    def gain_over(self, other: Outcome) -> float:
        """Returns -2 ln of the likelihood ratio to another run, over the drive.

        Against a run that used no observation, any other one is likelier.
        """
        if not (math.isfinite(self.cost) and math.isfinite(other.cost)):
            return (
                0.0 if self.cost == other.cost else math.copysign(math.inf, other.cost - self.cost)
            )
        return (other.cost - self.cost) * min(self.matched, other.matched)


NOTHING = Outcome(math.inf, 0, 0, 0, 0, math.nan, np.zeros(6), np.zeros(6))


class Bench:
    """Replays a recording with many settings, on all processors, each set once.

    Settings may hold four keys of its own: OFFSET (seconds to add to the frames' times), PART (0 or
    1: the first or the second half of the drive), LENGTH (number of frames) and SCALE (factor of
    the twists' velocities).
    """

    def __init__(self, program: Path, recording: Path, folder: Path, process: str = "") -> None:
        messages = framing.messages_of(recording)
        self.header = framing.header_of_messages(messages)
        asked = Process[process.upper()] if process else None
        self.examined = recording_of(messages, asked)
        part = within(first_frames(messages), round(OFFSET_MOST_S * 1e9))
        self._messages = not_before(part, BEGIN_NS)
        self._frames = Frames(self._messages)
        self._source, self._folder = recording, folder
        self._program = program
        self._outlier_cost = outlier_cost(self.header, messages)
        self._slots = Slots(self._messages)
        self._known: dict[tuple[tuple[str, str], ...], Outcome] = {}
        self._written: dict[tuple[str, ...], Path] = {}

    @property
    def by_imu(self) -> bool:
        return len(self.examined.inertial.t_ns) > 0

    def alike(self, one: Settings, other: Settings) -> bool:
        """Returns whether replays with these settings are the same."""
        timing = {"twist-timing": self.header.twist_timing.name.lower()}
        return _plain(timing | dict(one)) == _plain(timing | dict(other))

    def holds(self, kind: Kind) -> bool:
        return any(message.kind == kind for message in self._messages)

    def parts(self, offset_s: float) -> Parts:
        """Returns the recording cut into windows and halves, for comparing halves of the points."""
        messages = shifted(self._messages, round(offset_s * 1e9))
        return Parts(self._program, messages, self._folder)

    def run(self, settings: Settings) -> Outcome:
        return self.run_all([settings])[0]

    def run_all(self, many: Sequence[Settings], what: str = "replaying") -> list[Outcome]:
        """Returns the outcomes in the order of the settings."""
        keys = [tuple(sorted(_plain(settings).items())) for settings in many]
        new = [key for key in dict.fromkeys(keys) if key not in self._known]
        for key in new:
            self._recording(dict(key))
        with ThreadPoolExecutor(threads()) as pool:
            done = pool.map(self._replay, new)
            self._known.update(zip(new, progress(done, what, len(new)), strict=True))
        return [self._known[key] for key in keys]

    def _recording(self, settings: Settings) -> Path:
        """Returns the recording to replay, written at its first use."""
        asked = ((OFFSET, "0"), (PART, ""), (LENGTH, ""), (SCALE, "1"))
        key = tuple(settings.get(name, usual) for name, usual in asked)
        if key not in self._written:
            path = self._folder / f"tuning-{len(self._written)}.plr"
            messages = half(self._messages, int(key[1])) if key[1] else self._messages
            messages = first_frames(messages, int(key[2])) if key[2] else messages
            messages = scaled(messages, float(key[3]))
            moved = shifted(messages, round(float(key[0]) * 1e9))
            self._frames.write(path, moved)
            self._written[key] = path
        return self._written[key]

    def _replay(self, key: tuple[tuple[str, str], ...]) -> Outcome:
        settings = dict(key)
        recording = self._recording(settings)
        wanted = {k: v for k, v in settings.items() if not k.startswith("@")}
        options = options_of(self._slots.sparing(wanted) | {"gate-d2": GATE_D2})
        try:
            frames = stuffed_answers(self._program, recording, options)
        except PelorusError as error:
            words = str(error).replace(str(recording), str(self._source))
            raise PelorusError(words) from error
        poses = framing.only(reversed(frames), Kind.POSE)
        last = next((m for m in poses if isinstance(m, Pose) and m.after_stereo), None)
        return outcome_of(framing.rows_of(frames, Kind.REPORT), last, self._outlier_cost)


def _plain(settings: Settings) -> Settings:
    """Returns the settings without an OFFSET or SCALE that changes nothing: each is replayed once.

    A camera-offset becomes OFFSET: a session moves a frame past at most 64 steps.
    """
    kept = {k: v for k, v in settings.items() if k not in (CAMERA_OFFSET, OFFSET, SCALE)}
    moved_s = sum(float(settings.get(name, "0")) for name in (CAMERA_OFFSET, OFFSET))
    if round(moved_s, 6):
        kept[OFFSET] = f"{moved_s:.6f}"
    if float(settings.get(SCALE, "1")) != 1:
        kept[SCALE] = settings[SCALE]
    return kept


def outcome_of(reports: NDArray[np.void], last: Pose | None, cost_of_outlier: float) -> Outcome:
    """Returns the outcome from the rows of a filter's REPORTs and its last POSE."""
    rows = reports[(reports["subject"] == Kind.STEREO) & (reports["status"] == 0)]
    of_row = {name: rows[name].astype(np.float64) for name in SUMMED}
    matched, used, gated, count = (int(of_row[name].sum()) for name in COUNTED)
    if not matched or not count or last is None:
        return NOTHING
    normal = of_row["innovation_rows"] * math.log(2 * math.pi) + of_row["innovation_log_det"]
    by_frame = normal + of_row["innovation_d2"] + of_row["gated"] * cost_of_outlier
    cost = math.fsum(by_frame)
    return Outcome(
        cost / matched if math.isfinite(cost) else math.inf,
        matched,
        used,
        gated,
        len(by_frame),
        float(of_row["innovation_d2"].sum()) / count,
        np.asarray(last.bias, np.float64),
        np.asarray(last.bias_variance, np.float64),
        float(np.mean(rows["reasons"] & CONTRADICTED != 0)),
        _log_det(last),
        by_frame,
    )


def _log_det(pose: Pose) -> float:
    P = unpack_symmetric(np.array([pose.covariance], np.float64), POSE_SIZE)[0]
    sign, log_det = np.linalg.slogdet(P)
    return float(log_det) if sign > 0 and pose.knows_covariance else math.inf


def outlier_cost(header: Header, messages: Sequence[Message]) -> float:
    """Returns -2 ln of the density of an observation that may be anywhere: uL, v and disparity."""
    width, height = float(header.image_width_px), float(header.image_height_px)
    if not (width and height):
        seen = [m.pixels for m in messages if isinstance(m, Stereo) and len(m.pixels)]
        pixels = np.concatenate(seen) if seen else np.zeros((1, 4), np.float32)
        sound = pixels[np.isfinite(pixels).all(axis=1)]
        width, height = (float(np.ptp(sound[:, k])) + 1.0 for k in (0, 1))
    return 2 * math.log(width * height * DISPARITY_SPAN_PX)
