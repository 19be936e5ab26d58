# SPDX-License-Identifier: MIT
"""What a run says about itself, without truth: can it be trusted, and what is wrong?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from pelorus.arrivals import late_ones
from pelorus.check.calibration import Calibration
from pelorus.check.estimated import Estimated
from pelorus.check.mount import CAMERA_TURN, Turned
from pelorus.check.parameters import FRAMES_FEW, Tuned, of_process, starting
from pelorus.check.scale import Doubt
from pelorus.check.tracks_noise import DRIFT
from pelorus.frame_table import BIASES, FrameTable, frame_table
from pelorus.frames import Header, Kind, Message, Report
from pelorus.health import GOOD as OF_GOOD
from pelorus.health import HARMLESS, LOST, NOT_STARTED, TimeLine, time_line
from pelorus.schema import HEALTHS, number
from pelorus.settings import in_force

GOOD = HEALTHS[0]
LATE = number("status", "LATE")
# reasons that have a remark of their own
TOLD_APART = number("reason", "NO_TWISTS") | number("reason", "BIAS_OFF_PRIOR")
GOOD_MOST, DOUBTED_HALF, LOST_MANY = 0.95, 0.5, 0.1  # of the frames
GATED_MANY, GATED_MOST = 0.1, 0.3  # of the matches
WINDOW_S = 5.0
WORSE = 3.0  # times the usual share of a window that is worth naming
NIS_LOW, NIS_HIGH = 0.6, 1.6
BIAS_SIGMAS, BIAS_SIGMAS_BAD = 3.0, 10.0
OTHER_SIGMA = 1.2  # a setting that differs by more is told
FEW_USED = 8.0  # a frame
SHARE_MANY = 0.01  # of the way, that a bias may hide


class Grade(IntEnum):
    """From good to bad."""

    GOOD = 0
    CARE = 1
    BAD = 2


VERDICTS = {
    Grade.GOOD: "this can be trusted",
    Grade.CARE: "this can be trusted with care",
    Grade.BAD: "do not trust this",
}


@dataclass(frozen=True)
class Remark:
    """One thing that was looked at."""

    grade: Grade
    text: str


@dataclass(frozen=True)
class Run:
    """A whole replay with one set of settings."""

    messages: Sequence[Message]
    frames: FrameTable
    health: TimeLine

    @classmethod
    def of(cls, messages: Sequence[Message]) -> Run:
        return cls(messages, frame_table(messages), time_line(messages) or TimeLine(0, {}, ()))

    @property
    def good_share(self) -> float:
        return self.health.by_health.get(GOOD, 0) / max(self.health.frames, 1)

    @property
    def doubted_share(self) -> float:
        """Frames that are not good for more than a pause of the readings or a bias off its prior:
        these are graded by themselves, and what is not known in a pause is in the covariance.
        """
        frames = (m for m in self.messages if isinstance(m, Report) and m.subject == Kind.STEREO)
        known = TOLD_APART | HARMLESS | NOT_STARTED
        doubted = sum(m.health != OF_GOOD and m.reasons & ~known != 0 for m in frames)
        return doubted / max(self.health.frames, 1)

    @property
    def lost_share(self) -> float:
        lost = self.health.frames - sum(
            self.health.by_health.get(HEALTHS[k], 0) for k in range(LOST)
        )
        return lost / max(self.health.frames, 1)

    @property
    def gated_share(self) -> float:
        return float(self.frames["gated"].sum() / max(self.frames["matched"].sum(), 1))

    @property
    def nis(self) -> float:
        """Of all innovations of a frame together, a degree of freedom: 1 is due."""
        rows = self.frames["innovation_rows"].sum()
        return float(self.frames["innovation_d2"].sum() / rows) if rows else float("nan")


def remarks(run: Run, tuned: Tuned, origin_ns: int) -> list[Remark]:
    """Of the run with the tuned settings, and of what tuning has found."""
    return [
        *of_length(run.health.frames),
        *_health(run),
        *_order(run),
        *_gate(run, origin_ns),
        *_used(run),
        *_nis(run, tuned),
        *_biases(run),
        *_tracks(tuned),
        *_halves(tuned),
        *(Remark(Grade.CARE, words) for words in tuned.doubts),
        *(Remark(Grade.GOOD, words) for words in tuned.said),
    ]


def overall(found: Sequence[Remark]) -> Grade:
    """As the worst of them."""
    return max((remark.grade for remark in found), default=Grade.GOOD)


def of_length(frames: int) -> Iterator[Remark]:
    """What so few frames cannot tell."""
    if frames < FRAMES_FEW:
        yield Remark(
            Grade.CARE,
            f"only {frames} frames: of so few, noises are found to a fifth at best, and timing and "
            "biases may be chance. Compare before and after, or record a minute",
        )


def _health(run: Run) -> Iterator[Remark]:
    """Frames before an IMU's start are not counted: they are no loss."""
    grade = Grade.GOOD if run.good_share >= GOOD_MOST else Grade.CARE
    if run.lost_share > LOST_MANY or run.doubted_share > DOUBTED_HALF:
        grade = Grade.BAD
    words = f"health {run.health.summary()}"
    yield Remark(grade, words)
    misfit = number("reason", "NOISE_MISFIT")
    if any(isinstance(m, Report) and m.reasons & misfit for m in run.messages):
        yield Remark(
            Grade.CARE,
            "pictures and odometry (or IMU) differ by more than twice their sigmas all along, and "
            "no noise of single readings explains it (NOISE_MISFIT): a scale, a clock or a "
            "calibration is off a little; the covariance covers it",
        )


def _order(run: Run) -> Iterator[Remark]:
    """Where the recording is not in the order of time, and no twist-delay puts it there."""
    refused = [m.subject for m in run.messages if isinstance(m, Report) and m.status == LATE]
    for late in late_ones(run.messages):
        if refused.count(late.kind):
            yield Remark(Grade.BAD, late.words)


def _gate(run: Run, origin_ns: int) -> Iterator[Remark]:
    """The share, and where in the drive it is far above the usual."""
    share = run.gated_share
    grade = Grade.BAD if share > GATED_MOST else Grade.CARE if share > GATED_MANY else Grade.GOOD
    words = f"the gate rejects {share:.1%} of the matches"
    worst = _worst_window(run, origin_ns)
    if worst is not None and worst[2] > max(WORSE * share, GATED_MANY):
        words += f", {worst[2]:.0%} of them from {worst[0]:.0f} to {worst[1]:.0f} s"
    yield Remark(grade, words)


def _worst_window(run: Run, origin_ns: int) -> tuple[float, float, float] | None:
    t = (run.frames.t_ns - origin_ns) * 1e-9
    if not len(t):
        return None
    number = ((t - t[0]) // WINDOW_S).astype(np.int64)
    matched, gated = (np.bincount(number, run.frames[name]) for name in ("matched", "gated"))
    enough = matched >= 50
    if not enough.any():
        return None
    shares = np.where(enough, gated / np.maximum(matched, 1), 0)
    k = int(np.argmax(shares))
    return float(t[0] + k * WINDOW_S), float(t[0] + (k + 1) * WINDOW_S), float(shares[k])


def _used(run: Run) -> Iterator[Remark]:
    used = float(np.median(run.frames["used"]))
    if used < FEW_USED:
        yield Remark(Grade.CARE, f"only {used:.0f} observations of a frame are used (median)")


def _nis(run: Run, tuned: Tuned) -> Iterator[Remark]:
    words = f"what frames show differs from what was expected (innovations) by {run.nis:.2f} times "
    words += "the variance that the settings say"
    if tuned.noise.drifts:
        yield Remark(
            Grade.GOOD, f"{words}; less than once, for pixel-sigma stands for drift as well"
        )
    elif run.nis < NIS_LOW and tuned.halves is not None and tuned.halves.is_larger:
        yield Remark(
            Grade.GOOD, f"{words}; less than once, for the noises stand for what points share"
        )
    elif run.nis < NIS_LOW and tuned.noise.rows_px > 0:
        yield Remark(
            Grade.GOOD, f"{words}; less than once, for pixel-sigma stands for the rectification"
        )
    elif NIS_LOW <= run.nis <= NIS_HIGH:
        yield Remark(Grade.GOOD, words)
    else:
        due = starting_pixel(run) * float(np.sqrt(run.nis))
        words += ": the noise is not what these settings describe"
        yield Remark(Grade.CARE, f"{words}; pixel-sigma = {due:.2g} would be about right")


def starting_pixel(run: Run) -> float:
    """The pixel-sigma of a run."""
    return in_force(run.messages, "pixel-sigma") or 1.0


def _biases(run: Run) -> Iterator[Remark]:
    """Against their priors: beyond 3 sigma stereo and odometry disagree in something else."""
    by_imu = run.frames.by_imu
    if not (by_imu or in_force(run.messages, "bias")):
        return
    why = "do stereo and odometry disagree in scale?"
    if by_imu:
        why = "is it so large (give the prior), or are scale, axes or gravity wrong?"
    for name, axis in zip(BIASES, (*"xyz", *"xyz"), strict=True):
        kind = "gyro" if name.startswith("bias_w") else "accel" if by_imu else "velocity"
        prior = in_force(run.messages, f"bias-{kind}-sigma") or 0.0
        value = float(run.frames[name][-1])
        if prior > 0 and abs(value) > BIAS_SIGMAS * prior:
            beyond = abs(value) / prior
            yield Remark(
                Grade.BAD if beyond > BIAS_SIGMAS_BAD else Grade.CARE,
                f"the {kind} bias of {axis} is {value:.3g}, {beyond:.1f} sigma of its prior: {why}",
            )


def _tracks(tuned: Tuned) -> Iterator[Remark]:
    noise = tuned.noise
    if noise.rows is not None and noise.rows_px > 0:
        yield Remark(
            Grade.CARE,
            f"the rectification is off: the rows of left and right differ by "
            f"{noise.rows.smooth_px:.2f} px RMS, smoothly over the picture and up to "
            f"{noise.rows.largest_px:.1f} px, which all points share: in pixel-sigma, "
            f"{noise.rows_px:.2g} px stand for that. A better calibration is due",
        )
    if not noise.drifts:
        return
    known = {lag: sigma for lag, sigma in noise.by_lag.items() if np.isfinite(sigma)}
    first, last = min(known), max(known)
    yield Remark(
        Grade.CARE,
        f"the tracks drift: points are off by {known[first]:.2f} px after {first} frame and by "
        f"{known[last]:.2f} px after {last}; track-drift {tuned.settings.get(DRIFT, '0')} and in "
        f"pixel-sigma {noise.stands_for_px:.2g} px or more stand for that. Timing, clocks and the "
        "noise of single axes cannot be told by the likelihood of single steps then, and stay as "
        "given",
    )


def _halves(tuned: Tuned) -> Iterator[Remark]:
    """Whether parts of the points tell the same motion."""
    found = tuned.halves
    if found is None or not np.isfinite(found.before.ratio):
        return
    if not found.before.ratio > found.before.by_chance:
        yield Remark(Grade.GOOD, "each half of the points alone leads where all of them lead")
        return
    farther = f"{np.sqrt(found.before.ratio):.2g} times as far"
    words = f"half of the points alone ({found.before.way}) leads {farther} from where all of them "
    words += "lead as the noises allow: points share errors, of lens, rectification, tracker or "
    words += "things that move, or twists (or an IMU) are off for longer than a reading"
    if found.is_larger:
        words += f"; all noises are written {found.times:.2g} times as large for that: the "
        words += "estimate stays, and is less sure"
    else:
        words += "; larger noises would not mend it, and none are written"
    yield Remark(Grade.CARE, words)


def of_calibration(found: Calibration, own: Estimated | None = None) -> Iterator[Remark]:
    """What images and twists together say of the camera; `own`: what the filter estimates of it."""
    if found.scale is not None:
        yield from of_scale(found.scale)
    if own is not None:
        yield Remark(Grade.CARE if own.is_doubtful else Grade.GOOD, own.words())
    if found.turn is not None and not (own is not None and own.answers_turn):
        yield from of_turn(found.turn)


def of_turn(found: Turned) -> Iterator[Remark]:
    """Whether the camera looks where T_CB says."""
    if not found.is_off:
        return
    words = f"the camera looks {found.angle_deg:.1f} +- {found.sigma_deg:.1f} degrees beside where "
    words += "T_CB says, or the velocities are off across the way: positions may be off by "
    words += f"{found.beyond:.1%} of the way"
    words += f", for which {CAMERA_TURN} stands" if found.setting else ""
    yield Remark(Grade.CARE, f"{words}. Calibrate the camera's place on the body once more")


def of_scale(doubt: Doubt) -> Iterator[Remark]:
    """What is known of the stereo pair's scale is what the twists confirm."""
    if doubt.is_untold:
        yield Remark(
            Grade.CARE,
            "this drive is too short or too even to tell the scale of the stereo pair: positions "
            "are as good as its calibration (baseline-sigma, focal-sigma). Drive for a minute, "
            "with changing speed, and turn both ways",
        )
        return
    shown = f"the images show {doubt.scale:.3f} +- {doubt.sigma:.3f} times the twists' way"
    if not doubt.beyond:
        yield Remark(Grade.GOOD, f"{shown}: the filter's own doubt covers that")
        return
    off = f"positions may be off by {doubt.share:.1%} of the way"
    off += ", for which baseline-sigma stands" if doubt.setting else ""
    bias = f"a bias of the velocities of {doubt.bias_mps:.2g} m/s"
    hidden = doubt.by_bias and doubt.share > SHARE_MANY
    if doubt.is_off:
        why = f"{shown}: baseline, focal length or wheels' radius are off, or more than {bias}"
    elif doubt.by_bias:
        why = f"this drive cannot tell the scale of the stereo pair from {bias}: beside it {shown}"
        off += ". Drive with changing speed"
    else:
        why = f"this drive does not tell the scale of the stereo pair better: {shown}"
        off += ". A longer drive tells more"
    yield Remark(Grade.CARE if doubt.is_off or hidden else Grade.GOOD, f"{why}; {off}")


def changes(given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool) -> list[str]:
    """`pixel-sigma 2 should be 1`: what differs by more than a fifth, or in words."""
    return [
        f"{' '.join(filter(None, (name, was)))} should be {due}"
        for name, was, due in _changed(given, header, tuned, by_imu)
    ]


def lines(given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool) -> list[str]:
    """The same as lines of a config."""
    return [f"{name} = {due}" for name, _, due in _changed(given, header, tuned, by_imu)]


def _changed(
    given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool
) -> Iterator[tuple[str, str, str]]:
    """Name, what it was if that is a number, and what it should be."""
    parameters = of_process(by_imu)
    before = starting(header, given, parameters)
    for name, parameter in parameters.items():
        written = tuned.settings.get(parameter.setting, "")
        after = [float(part) for part in written.split(",") if part]
        was = [before[name]] if name in before else [before[f"{name}-{axis}"] for axis in "xyz"]
        count = max(len(was), len(after))
        pairs = zip(was * (count // len(was)), after * (count // max(len(after), 1)), strict=False)
        ratios = [max(x / y, y / x) for x, y in pairs if x > 0]
        if ratios and max(ratios) > OTHER_SIGMA:
            yield parameter.setting, ",".join(f"{x:.3g}" for x in was), written
    for setting in KEPT:
        value = tuned.settings.get(setting)
        if value is not None and value != given.get(setting, _usual(setting, header)):
            yield setting, "", value


KEPT = (
    "twist-timing",
    "imu-timing",
    "bias",
    "camera-offset",
    "baseline-sigma",
    CAMERA_TURN,
    DRIFT,
)


def _usual(setting: str, header: Header) -> str:
    usual = {"twist-timing": header.twist_timing.name.lower(), "bias": "on", "imu-timing": "mid"}
    return usual.get(setting, "0")
