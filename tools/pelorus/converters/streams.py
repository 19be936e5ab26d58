# SPDX-License-Identifier: MIT
"""A user's own data in any format: streams with times, and a calibration.

Each importer reads one format into Streams; `recording` makes a recording of them: pictures are
rectified and tracked, raw tracks rectified, frames moved to the body's clock, the truth to the
frames.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pelorus.converters import earth_start, full_scale, repeated, twist_noise
from pelorus.errors import PelorusError
from pelorus.faults import resolution, stale
from pelorus.faults.finding import Finding
from pelorus.faults.mend import findings_of, mend
from pelorus.io.foreign import ForeignFileError
from pelorus.io.recording import Recording
from pelorus.io.tracks import Tracks
from pelorus.io.trajectory import Trajectory, filled
from pelorus.math.inertial import NO_READINGS, Inertial
from pelorus.math.motion import Times
from pelorus.rig.lens import LensModel
from pelorus.rig.read import Calibrated
from pelorus.rig.rectification import Gray, Rectification
from pelorus.rig.rig import Rig
from pelorus.wire.frames import TEXT_BYTES_MAX, Header, Noise, Process, Reading, Text, TwistTiming
from pelorus.wire.layout import Floats

FORCES_MPS2 = (5.0, 15.0)
BLIND_VELOCITY_MPS = 0.2  # sigma along an axis that nothing measures: wheels do not slide
RESOLUTIONS = 8  # stamps may be rounded to 10 ms, and to each finer power of ten
PAUSE_STEPS = 5.0  # a longer gap, in periods, is a pause, across which nothing is interpolated
# The fastest turn of a robot while its tracks hold, about an axis that nothing measures: the
# pictures find the rotation. It is constant between two frames, in all readings between them.
BLIND_TURN_RADPS = 3.0


class TwistIn(StrEnum):
    """The axes in which twists are given; with `poses` they are computed from the user's poses."""

    AUTO = "auto"
    BODY = "body"
    WORLD = "world"
    WORLD_VELOCITY = "world-velocity"
    POSES = "poses"


@dataclass(frozen=True)
class Twists:
    """Velocities in body axes; zero where `measured` says that nobody measured them."""

    where: Path
    t_ns: Times
    v_B_mps: Floats
    w_B_radps: Floats
    measured: frozenset[str] = frozenset(("vx", "vy", "vz", "wx", "wy", "wz"))
    frame: str = ""  # the body's name, where the source has it

    @property
    def is_whole(self) -> bool:
        return len(self.measured) == 6


@dataclass(frozen=True)
class Readings:
    """The readings of an IMU."""

    where: Path
    inertial: Inertial
    frame: str = ""

    @property
    def t_ns(self) -> Times:
        return self.inertial.t_ns


@dataclass(frozen=True)
class Asked:
    """What the user adds to a folder or a bag, or says instead of it.

    `calibration`, `extrinsic`, `lens` and `cameras` are as rig.read has them.
    """

    calibration: tuple[Path, ...] = ()
    extrinsic: Path | None = None
    lens: LensModel | None = None
    cameras: tuple[str, ...] = ()
    motion: Twists | Readings | None = None
    truth: Trajectory | None = None
    measured: frozenset[str] = Twists.measured  # of the source's own twists
    axes: TwistIn = TwistIn.AUTO  # likewise
    timing: TwistTiming | None = None
    fix: bool = True
    remarks: tuple[str, ...] = ()
    keep_pictures: bool = False


@dataclass(frozen=True)
class Pictures:
    """Stereo pairs as the left and the right camera took them; `read` yields them in order."""

    where: tuple[Path, Path]
    t_ns: Times
    read: Callable[[], Iterator[tuple[Gray, Gray]]]


@dataclass(frozen=True)
class RawTracks:
    """Tracks, in the pixels of the calibration's cameras."""

    where: Path
    t_ns: Times
    tracks: Tracks


@dataclass(frozen=True)
class Streams:
    """Twists or an IMU, and what the cameras saw."""

    calibrated: Calibrated
    frames: Pictures | RawTracks
    motion: Twists | Readings
    truth: Trajectory | None = None
    small: list[Reading] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    on_earth: bool = False  # its positions are east, north and up of a place
    # of the filter, as far as they are known
    settings: dict[str, float] = field(default_factory=dict)

    @property
    def all_remarks(self) -> list[str]:
        """Returns what the user should know of how the files were read."""
        of_truth = self.truth.remarks if self.truth else ()
        return [*self.remarks, *of_truth, *self.calibrated.remarks]


def recording(streams: Streams) -> Recording:
    """Makes a recording."""
    return _made(streams)[0]


def _made(streams: Streams) -> tuple[Recording, list[Finding]]:
    """Returns the recording, and what was found in making it."""
    calibrated, frames = streams.calibrated, streams.frames
    t_ns = frames.t_ns
    if calibrated.rig is not None:
        t_ns = calibrated.rig.on_body_clock(t_ns)
    where = frames.where if isinstance(frames, RawTracks) else frames.where[0]
    require_overlap(where, t_ns, streams.motion)
    truth = None if streams.truth is None else at_frames(streams.truth, t_ns, streams.motion)
    if isinstance(frames, Pictures):
        from pelorus.converters.expected import tracked  # noqa: PLC0415 - it loads the library

        repeats = repeated.Repeats(_moves(streams.motion, t_ns), t_ns)
        header, tracks = tracked(streams, frames, t_ns, repeats)
        t_ns = repeats.kept_t_ns
        found = repeats.findings
    else:
        header, tracks = _of_raw(calibrated, frames)
        moves = _moves(streams.motion, t_ns)
        t_ns, tracks, found = repeated.left_out(moves, t_ns, tracks, header.camera)
    made, more = of_drive(header, streams, t_ns, tracks, truth)
    return made, [*found, *more]


def of_drive(
    header: Header, streams: Streams, t_ns: Times, tracks: Tracks, truth: Trajectory | None
) -> tuple[Recording, list[Finding]]:
    """Returns a recording of the tracks with motion and truth, and what was found of an IMU.

    `truth` is that of at_frames; an IMU's readings begin with it.
    """
    found: list[Finding] = []
    made = with_motion(header, streams, t_ns, tracks)
    if isinstance(streams.motion, Readings):
        made, found = full_scale.with_ranges(made, streams.motion.inertial)
        made = replace(made, inertial=_from_truth(made.inertial, truth, t_ns))
    return (made if truth is None else made.with_truth(truth.t_ns, truth.poses)), found


def converted(
    found: Streams, timing: TwistTiming | None, fix: bool
) -> tuple[Recording, list[Finding]]:
    """Returns the recording and the findings; with `fix` it is mended, and the twists' noise
    measured.

    `timing` overrides the calibration's. Without all six velocities only the tracks can be judged.
    A drive by an IMU is judged, not mended.
    """
    if timing is not None:  # of the twists that eyes are told, too
        header = replace(found.calibrated.header, twist_timing=timing)
        found = replace(found, calibrated=replace(found.calibrated, header=header))
    made, placed = _made(found)
    if found.on_earth and found.truth is None:
        made, finding = earth_start.started(made)
        placed = [*placed, finding]
    if not fix or not len(made.tracks):
        return made, placed
    if not isinstance(found.motion, Twists):
        return made, [*placed, *findings_of(made)]
    if not found.motion.is_whole:
        made, finding = stale.mend(made)
        return made, [*placed, finding]
    mended = mend(made)
    made, finding = twist_noise.suggest(mended.recording)
    return made, [*placed, *mended.changes, finding, *mended.told]


# --- motion ---------------------------------------------------------------------------------------


def with_motion(header: Header, streams: Streams, t_ns: Times, tracks: Tracks) -> Recording:
    """Returns a recording of the tracks with the streams' twists or IMU, and their remarks."""
    remarks = [Text(words[:TEXT_BYTES_MAX]) for words in streams.all_remarks]
    motion = streams.motion
    if isinstance(motion, Twists):
        in_frame = max(_interval_s(t_ns) / _interval_s(motion.t_ns), 1.0)
        header = replace(header, noise=_with_blind_axes(header.noise, motion.measured, in_frame))
        moved = (motion.t_ns, motion.v_B_mps, motion.w_B_radps)
        inertial, first_ns = NO_READINGS, int(motion.t_ns[0])
    else:
        model = streams.calibrated.imu
        told = {name: s for name, s in vars(model.noise).items() if s >= 0}
        _require_gravity(motion)
        header = replace(header, process=Process.IMU, noise=replace(header.noise, **told))
        moved = (np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)))
        inertial = model.correction.of(motion.inertial)
        first_ns = int(inertial.t_ns[0])
    # the filter begins with the first twist or reading
    small = [reading for reading in streams.small if reading.t_ns >= first_ns]
    return Recording(
        header,
        *moved,
        t_ns,
        tracks,
        readings=small,
        remarks=remarks,
        inertial=inertial,
        settings=streams.settings,
    )


def _require_gravity(readings: Readings) -> None:
    """Refuses an IMU without gravity: at rest, or level on average, it must measure 9.81 m/s^2."""
    usual = float(np.median(np.linalg.norm(readings.inertial.a_B_mps2, axis=1)))
    if not FORCES_MPS2[0] <= usual <= FORCES_MPS2[1]:
        raise ForeignFileError(
            readings.where,
            f"the specific force is {usual:.3g} m/s^2 in the median; about 9.81 is expected: is it "
            "in g (--columns ax=COLUMN:g and so on), or has gravity been taken away? Raw readings "
            "are expected",
        )


def _interval_s(t_ns: Times) -> float:
    return float(np.median(np.diff(t_ns))) * 1e-9 if len(t_ns) > 1 else 1.0


def _with_blind_axes(noise: Noise, measured: frozenset[str], in_frame: float) -> Noise:
    """Returns the noise with sigmas for what nobody measured, unless the calibration has some.

    The noises of `in_frame` readings between frames average, so each has the root of that many
    times the sigma of the turn.
    """
    turn_radps = BLIND_TURN_RADPS * float(np.sqrt(in_frame))
    given = {
        **{f"velocity_sigma_{a}_mps": BLIND_VELOCITY_MPS for a in "xyz" if f"v{a}" not in measured},
        **{f"gyro_sigma_{a}_radps": turn_radps for a in "xyz" if f"w{a}" not in measured},
    }
    told = vars(noise)
    return replace(noise, **{name: s for name, s in given.items() if told[name] <= 0})


def with_gyro(
    twists: Twists, where: Path, gyro_t_ns: Times, w_B_radps: Floats, timing: TwistTiming
) -> Twists:
    """Returns the twists with a gyro's rates: each has the mean over the time for which it holds.

    So the rotation between two twists is the gyro's, at any rate of its readings. Twists without
    gyro readings are left out.
    """
    t = twists.t_ns
    inside = (t >= gyro_t_ns[0]) & (t <= gyro_t_ns[-1])
    if inside.sum() < 2:
        raise _apart(where, gyro_t_ns, twists.where, t)
    t = t[inside]
    cuts = _held_between(t, timing)
    steps = np.diff(gyro_t_ns) * 1e-9
    turned = np.cumsum(0.5 * (w_B_radps[1:] + w_B_radps[:-1]) * steps[:, None], axis=0)
    angle = np.concatenate((np.zeros((1, 3)), turned))
    seconds, own = (cuts - gyro_t_ns[0]) * 1e-9, (gyro_t_ns - gyro_t_ns[0]) * 1e-9
    at = np.stack([np.interp(seconds, own, x) for x in angle.T], axis=-1)
    w = np.diff(at, axis=0) / np.diff(seconds)[:, None]
    if timing is TwistTiming.START:
        w = np.concatenate((w, w[-1:]))
    elif timing is TwistTiming.END:
        w = np.concatenate((w[:1], w))
    measured = twists.measured | {"wx", "wy", "wz"}
    return Twists(twists.where, t, twists.v_B_mps[inside], w, measured, twists.frame)


def joined(
    accel: Path,
    gyro: Path,
    forces: tuple[Times, Floats],
    rates: tuple[Times, Floats],
    remarks: list[str],
) -> Inertial:
    """Joins an accelerometer and a gyro with clocks of their own, each as times and numbers.

    The slower one is interpolated to the times of the faster one, but not across its pauses.
    """
    slow, fast = sorted((forces, rates), key=lambda one: len(one[0]))
    (own, x), (t_ns, _) = slow, fast
    after = np.clip(np.searchsorted(own, t_ns), 1, max(len(own) - 1, 1))
    inside = (t_ns >= own[0]) & (t_ns <= own[-1])
    if len(own) < 2 or inside.sum() < 2:
        raise _apart(accel, forces[0], gyro, rates[0])
    steps = np.diff(own)
    near = steps[after - 1] <= PAUSE_STEPS * np.median(steps)
    kept = inside & near
    seconds, at = (own - own[0]) * 1e-9, (t_ns[kept] - own[0]) * 1e-9
    between = np.stack([np.interp(at, seconds, column) for column in x.T], axis=-1)
    names = (accel, gyro) if slow is forces else (gyro, accel)
    left_out = int((~kept).sum())
    remarks.append(
        f"{names[0]}: interpolated to the times of {names[1]}"
        + (f", of which {left_out} lie outside or in its pauses and are left out" * bool(left_out))
    )
    both = (between, fast[1][kept]) if slow is forces else (fast[1][kept], between)
    return Inertial(t_ns[kept], *both)


def _held_between(t_ns: Times, timing: TwistTiming) -> Times:
    """Returns the times between which readings hold: their own, or half way if centred."""
    if timing is not TwistTiming.MID:
        return t_ns
    half_way = t_ns[:-1] + np.diff(t_ns) // 2
    return np.concatenate((t_ns[:1], half_way, t_ns[-1:]))


def _moves(motion: Twists | Readings, t_ns: Times) -> NDArray[np.bool_]:
    """Returns whether the body moves from frame to frame; by an IMU, whether it turns."""
    if isinstance(motion, Twists):
        return repeated.moves(t_ns, motion.t_ns, motion.w_B_radps, motion.v_B_mps)
    w = motion.inertial.w_B_radps
    return repeated.moves(t_ns, motion.inertial.t_ns, w - np.median(w, axis=0), None)


def require_overlap(where: Path, t_ns: Times, motion: Twists | Readings) -> None:
    """Raises ForeignFileError where the times of a file are not while the body is moved."""
    own = motion.t_ns
    if t_ns[-1] < own[0] or own[-1] < t_ns[0]:
        raise _apart(where, t_ns, motion.where, own)


def _apart(where: Path, t_ns: Times, other: Path, own: Times) -> ForeignFileError:
    spans = f"spans {t_ns[0]} to {t_ns[-1]} ns, {other} {own[0]} to {own[-1]} ns"
    return ForeignFileError(where, f"{spans}: they do not overlap")


# --- tracks in the pixels of the cameras ----------------------------------------------------------


def _of_raw(calibrated: Calibrated, frames: RawTracks) -> tuple[Header, Tracks]:
    """Returns the HEADER of the rectified camera, and the tracks in its pixels."""
    header, tracks, rig = calibrated.header, frames.tracks, calibrated.rig
    if len(calibrated.sizes) == 1 and (
        wrong := resolution.beyond(tracks.pixels, *calibrated.sizes)
    ):
        raise ForeignFileError(
            frames.where,
            f"{wrong}; the calibration of these pictures, or pixels of those, are expected",
        )
    if rig is None:
        return header, tracks
    rig = _at_resolution(rig, tracks)
    rectification = rig.rectification()
    return rig.header(rectification, header.name), _rectified(tracks, rectification, frames.where)


def _at_resolution(rig: Rig, tracks: Tracks) -> Rig:
    """Returns the rig at the smallest of its resolutions that holds all pixels."""
    if not rig.others or not len(tracks):
        return rig
    most = tracks.pixels.max(axis=0).reshape(2, 2).max(axis=0)
    holding = [size for size in rig.sizes if (most < size).all()]
    if not holding:
        raise ForeignFileError(
            rig.path,
            f"pixels reach ({most[0]:.0f}, {most[1]:.0f}), beyond every resolution; the "
            "calibration of these pictures is needed",
        )
    return rig.of_size(*min(holding, key=np.prod))


def _rectified(tracks: Tracks, rectification: Rectification, source: Path) -> Tracks:
    """Rectifies the cameras' pixels; leaves out those that no ray of the lens reaches."""
    pixels = rectification.pixels(tracks.pixels)
    good = np.isfinite(pixels).all(axis=1)
    if not good.any():
        raise ForeignFileError(
            source,
            "no pixel is one of the calibration's lenses; pixels as the cameras took them are "
            "expected, of the calibration's resolution",
        )
    return replace(tracks, pixels=pixels).at(np.nonzero(good)[0])


# --- truth ----------------------------------------------------------------------------------------


def at_frames(truth: Trajectory, frame_t_ns: Times, motion: Twists | Readings) -> Trajectory:
    """Returns the truth while the sensors run, with a pose at each frame and where the motion
    begins.

    The filter is compared at the frames, and starts from the first pose. What a motion capture saw
    before or after the sensors ran is not of the drive.
    """
    t_ns, own = truth.t_ns, motion.t_ns
    if frame_t_ns[-1] < t_ns[0] or t_ns[-1] < frame_t_ns[0]:
        raise PelorusError(
            f"the truth spans {t_ns[0]} to {t_ns[-1]} ns, the frames {frame_t_ns[0]} to "
            f"{frame_t_ns[-1]} ns: they do not overlap; times on the twists' clock are expected"
        )
    if own[0] < t_ns[0] <= own[0] + _resolution_ns(t_ns):
        t_ns = np.concatenate((own[:1], t_ns[1:]))  # rounded by the interpolation
    whole = filled(truth._replace(t_ns=t_ns), np.union1d(frame_t_ns, own[:1]))
    first, last = own[0], max(own[-1], frame_t_ns[-1])
    inside = (whole.t_ns >= first) & (whole.t_ns <= last)
    return Trajectory(whole.t_ns[inside], whole.poses.at(inside), whole.remarks)


def _resolution_ns(t_ns: Times) -> int:
    """Returns the rounding of the stamps: the largest power of ten that divides all of them."""
    return max(int(10**k) for k in range(RESOLUTIONS) if not (t_ns % 10**k).any())


def _from_truth(readings: Inertial, truth: Trajectory | None, frame_t_ns: Times) -> Inertial:
    """Returns the readings from the beginning of the truth on, if it is between first reading and
    frame.

    The filter then starts from its pose.
    """
    if truth is None or not readings.t_ns[0] < truth.t_ns[0] <= frame_t_ns[0]:
        return readings
    return readings.at(readings.t_ns >= truth.t_ns[0])
