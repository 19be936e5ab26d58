# SPDX-License-Identifier: MIT
"""Judges a run: can it be trusted, why, and what should be set otherwise?

This is the one place that says so: `check`, `try`, `report` and `explain` show what comes from
here. The verdict rests on what the recording shows by itself (known.py), on what the filter said of
itself in this run, and on the recording's truth where it has one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from pelorus.check.calibration import CAMERA_TURN, CalibrationDoubts, Doubt, Turned, calibration
from pelorus.check.covering import covering, noises_are_usual, not_covered
from pelorus.check.estimated import Estimated, estimated
from pelorus.check.known import Known, known_of
from pelorus.check.parameters import FRAMES_FEW, Tuned
from pelorus.check.tracks_noise import DRIFT, differs_clearly
from pelorus.evaluate.evaluation import judge
from pelorus.evaluate.frame_table import BIASES, FrameTable, frame_table
from pelorus.evaluate.health import GOOD as OF_GOOD
from pelorus.evaluate.health import HARMLESS, LOST, NOT_STARTED, TimeLine, time_line
from pelorus.faults.mend import BEHIND, CANNOT, known_words
from pelorus.io.arrivals import late_ones
from pelorus.io.trajectory import truth_in
from pelorus.wire.frames import Kind, Message, Report
from pelorus.wire.schema import HEALTHS, number
from pelorus.wire.settings import IDS, SETTINGS, in_force

GOOD = HEALTHS[0]
LATE = number("status", "LATE")
# reasons that have a remark of their own
TOLD_APART = number("reason", "NO_TWISTS") | number("reason", "BIAS_OFF_PRIOR")
NOT_POSITIVE = number("reason", "NOT_POSITIVE")
GOOD_MOST, DOUBTED_HALF, LOST_MANY = 0.95, 0.5, 0.1  # of the frames
GATED_USUAL = 0.01  # share of inliers outside the gate, by its level
GATED_MANY, GATED_MOST = 0.05, 0.3  # share of the matches
WINDOW_S = 5.0
WORSE = 3.0  # ratio to the usual share from which a window is reported
NIS_LOW, NIS_HIGH = 0.6, 1.6
NEES_HIGH, NEES_BAD = 2.0, 9.0  # per degree of freedom: errors three times as large as their sigma
TRUTH_FEW = 20  # the NEES of fewer frames means nothing
BIAS_SIGMAS, BIAS_SIGMAS_BAD = 3.0, 10.0
FEW_USED = 8.0  # observations a frame
SHARE_MANY = 0.01  # of the way, that a bias may hide
PIXEL = "pixel-sigma"
REASONS_TOLD = 3  # on a terminal


class Grade(IntEnum):
    """Grades, from good to bad."""

    GOOD = 0
    CARE = 1
    BAD = 2


VERDICTS = {
    Grade.GOOD: "this can be trusted",
    Grade.CARE: "this can be trusted with care",
    Grade.BAD: "do not trust this",
}
MARKS = ("good", "care", "bad")
NOTE = "note"
NOISES = "`pelorus check` on the recording writes noises that fit"


@dataclass(frozen=True)
class Remark:
    """A finding with its grade; a note is about the search and does not affect the verdict."""

    grade: Grade
    text: str
    is_note: bool = False

    @property
    def mark(self) -> str:
        return NOTE if self.is_note else MARKS[self.grade]


@dataclass(frozen=True)
class Verdict:
    """The verdict on a run.

    `share`: position error as a share of the way, beyond what the settings say. `settings`: what
    the recording itself asks for. `noises`: remarks on noises that `check` can mend.
    """

    grade: Grade
    remarks: tuple[Remark, ...] = ()
    share: float = 0.0
    settings: Mapping[str, str] = field(default_factory=dict)
    noises: bool = False
    is_stopped: bool = False  # by a fault that must be mended first

    def __str__(self) -> str:
        return self.words

    @property
    def words(self) -> str:
        """Returns the verdict in words."""
        told = self.share > 0 and self.grade is not Grade.BAD
        words = VERDICTS[self.grade]
        return f"{words}, to {self.share:.1%} of the way" if told else words

    @property
    def mark(self) -> str:
        return MARKS[self.grade]

    @property
    def doubts(self) -> list[str]:
        """Returns the reasons against a better grade, the worst first."""
        odd = [remark for remark in self.remarks if remark.grade and not remark.is_note]
        return [remark.text for remark in sorted(odd, key=lambda remark: -remark.grade)]

    @property
    def to_set(self) -> list[str]:
        """Returns the settings to change, in words."""
        lines = [f"{name} = {value}" for name, value in self.settings.items()]
        said = [f"set {'; '.join(lines)}"] if lines else []
        if self.noises and not self.is_stopped:
            said.append(NOISES)
        return said

    def json(self) -> dict[str, object]:
        """Returns the verdict as JSON, with the same names in every command."""
        return {
            "verdict": self.words,
            "grade": self.mark,
            "why": self.doubts,
            "what_to_set": dict(self.settings),
        }

    def lines(self) -> list[str]:
        """Returns the verdict as lines for a terminal."""
        doubts = self.doubts
        hidden = [f"and {len(doubts) - REASONS_TOLD} more"] * (len(doubts) > REASONS_TOLD)
        why = [f"   {words}" for words in (*doubts[:REASONS_TOLD], *hidden)]
        return [self.words, *why, *(f"   what to do: {words}" for words in self.to_set)]


@dataclass(frozen=True)
class JudgedRun:
    """A whole replay with one set of settings."""

    messages: Sequence[Message]
    frames: FrameTable
    health: TimeLine

    @classmethod
    def of(cls, messages: Sequence[Message]) -> JudgedRun:
        return cls(messages, frame_table(messages), time_line(messages) or TimeLine(0, {}, ()))

    @property
    def origin_ns(self) -> int:
        return int(self.frames.t_ns[0])

    @property
    def good_share(self) -> float:
        return self.health.by_health.get(GOOD, 0) / max(self.health.frames, 1)

    @property
    def doubted_share(self) -> float:
        """Returns the share of frames doubted for other reasons than a pause or a bias off its
        prior.

        Those two are graded by themselves, and the covariance covers a pause.
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
        """Returns the NIS of all innovations per degree of freedom: 1 is expected."""
        rows = self.frames["innovation_rows"].sum()
        return float(self.frames["innovation_d2"].sum() / rows) if rows else float("nan")


def verdict_of_log(messages: Sequence[Message]) -> Verdict:
    """Judges a filter's result that contains the recording; no value in it raises an error."""
    return judged_log(messages)[2]


def judged_log(messages: Sequence[Message]) -> tuple[JudgedRun, Known, Verdict]:
    """Returns the run, what its recording shows by itself, and the verdict on both."""
    with np.errstate(all="ignore"):
        run = JudgedRun.of(messages)
        try:
            known = known_of(messages)
            return run, known, verdict_of(run, known)
        except np.linalg.LinAlgError:  # nothing can be fitted: judges the run alone
            return run, Known(), verdict_of(run, Known())


def verdict_of(run: JudgedRun | None, known: Known) -> Verdict:
    """Judges a run. It is not examined where a fault of the recording must be mended first."""
    log = [] if run is None else run.messages
    grades = Grade.CARE, Grade.BAD
    faults = [Remark(grades[f.grave], f.sentence) for f in not_covered(log, known.faults)]
    agreed = known.judged.agreed
    if known.is_stopped or run is None:
        told = BEHIND if agreed is None else f"{known_words(agreed)}; {CANNOT}"
        return Verdict(Grade.BAD, (*faults, Remark(Grade.CARE, told)), is_stopped=True)
    camera = calibration(known.agreed, run.messages)
    settings = {**camera.settings, **_for_tracks(run, known), **covering(log, known.faults)}
    own = estimated(run.messages, camera)
    found = [*faults, *_of_run(run, known), *of_calibration(camera, own)]
    if agreed is not None:
        found.append(Remark(Grade.GOOD, f"{known_words(agreed)}; {CANNOT}"))
    nis_off = not NIS_LOW <= run.nis <= NIS_HIGH and not settings and noises_are_usual(log)
    return Verdict(overall(found), tuple(found), camera.share, settings, nis_off)


def _of_run(run: JudgedRun, known: Known) -> Iterator[Remark]:
    yield from of_length(run.health.frames)
    yield from _diverged(run)
    yield from _health(run)
    yield from _order(run)
    yield from _gate(run)
    yield from _used(run)
    yield from _nis(run, known)
    yield from _biases(run)
    yield from _tracks(run, known)
    yield from _truth(run)


def of_search(tuned: Tuned) -> list[Remark]:
    """Returns the notes of the search for settings."""
    said = [*_halves(tuned), *tuned.doubts, *tuned.said]
    return [Remark(Grade.GOOD, words, is_note=True) for words in said]


def overall(found: Sequence[Remark]) -> Grade:
    """Returns the worst of the remarks' grades."""
    return max((remark.grade for remark in found if not remark.is_note), default=Grade.GOOD)


def of_length(frames: int) -> Iterator[Remark]:
    """Yields a remark where the drive is too short to judge."""
    if frames < FRAMES_FEW:
        yield Remark(
            Grade.CARE,
            f"only {frames} frames: of so few, noises are found to a fifth at best, and timing and "
            "biases may be chance. Compare before and after, or record a minute",
        )


def _health(run: JudgedRun) -> Iterator[Remark]:
    """Yields remarks on lost and doubted frames; those before an IMU's start are not lost."""
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


def _order(run: JudgedRun) -> Iterator[Remark]:
    """Yields a remark where times go back, and no twist-delay mends it."""
    refused = [m.subject for m in run.messages if isinstance(m, Report) and m.status == LATE]
    for late in late_ones(run.messages):
        if refused.count(late.kind):
            yield Remark(Grade.BAD, late.words)


def _diverged(run: JudgedRun) -> Iterator[Remark]:
    """Yields a remark where a variance is not positive: the arithmetic failed."""
    frames = run.frames.t_ns[(run.frames.reasons & NOT_POSITIVE) != 0]
    if len(frames):
        first_s = (int(frames[0]) - run.origin_ns) * 1e-9
        yield Remark(
            Grade.BAD,
            f"it diverged in {len(frames)} frame{'s' * (len(frames) > 1)}, first at "
            f"{first_s:.1f} s: a variance ceased to be positive, and the landmarks were dropped",
        )


def _truth(run: JudgedRun) -> Iterator[Remark]:
    """Yields a remark on whether the errors match the covariance, where the truth is known."""
    if truth_in(run.messages) is None:
        return
    figures = judge(run.messages)
    nees, frames = figures.get("nees_per_dof"), figures.get("truth_frames") or 0
    if nees is None or frames < TRUTH_FEW:
        return
    words = f"beside the recording's truth its errors are {np.sqrt(nees):.2g} times as large as it "
    words += f"says (NEES/6 {nees:.3g}; 1 is expected)"
    grade = Grade.BAD if nees > NEES_BAD else Grade.CARE if nees > NEES_HIGH else Grade.GOOD
    yield Remark(grade, words)


def _gate(run: JudgedRun) -> Iterator[Remark]:
    """Yields a remark on the share of gated matches, and where it is far above the usual."""
    share = run.gated_share
    grade = Grade.BAD if share > GATED_MOST else Grade.CARE if share > GATED_MANY else Grade.GOOD
    words = f"the gate rejects {share:.1%} of the matches"
    if share > 2 * GATED_USUAL:
        words += f" where {GATED_USUAL:.0%} is expected: the rest it takes for wrong"
    worst = _worst_window(run, run.origin_ns)
    if worst is not None and worst[2] > max(WORSE * share, GATED_MANY):
        words += f", {worst[2]:.0%} of them from {worst[0]:.0f} to {worst[1]:.0f} s"
    yield Remark(grade, words)


def _worst_window(run: JudgedRun, origin_ns: int) -> tuple[float, float, float] | None:
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


def _used(run: JudgedRun) -> Iterator[Remark]:
    used = float(np.median(run.frames["used"]))
    if used < FEW_USED:
        yield Remark(Grade.CARE, f"only {used:.0f} observations of a frame are used (median)")


def _nis(run: JudgedRun, known: Known) -> Iterator[Remark]:
    """Yields a remark where the NIS exceeds 1; noises that cover lasting errors make it smaller."""
    if not np.isfinite(run.nis):
        return
    words = f"what frames show differs from what was expected (innovations) by {run.nis:.2f} times "
    words += "the variance that the settings say"
    drifts = known.noise is not None and known.noise.drifts
    if run.nis <= NIS_HIGH or drifts:
        less = "; less than once: it is surer than it says, or the noises stand for what lasts"
        yield Remark(Grade.GOOD, words + less * bool(run.nis < NIS_LOW))
    else:
        yield Remark(Grade.CARE, f"{words}: the noise is not what these settings describe")


def _biases(run: JudgedRun) -> Iterator[Remark]:
    """Yields remarks on biases beyond 3 sigma of their priors: stereo and odometry disagree."""
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


def _tracks(run: JudgedRun, known: Known) -> Iterator[Remark]:
    noise = known.noise
    if noise is None:
        return
    if noise.rows is not None and noise.rows_px > 0:
        yield Remark(
            Grade.CARE,
            f"the rectification is off: the rows of left and right differ by "
            f"{noise.rows.smooth_px:.2f} px RMS, smoothly over the picture and up to "
            f"{noise.rows.largest_px:.1f} px, which all points share: in pixel-sigma, "
            f"{noise.rows_px:.2g} px stand for that. A better calibration would mend it",
        )
    if not noise.drifts:
        return
    lags = {lag: sigma for lag, sigma in noise.by_lag.items() if np.isfinite(sigma)}
    first, last = min(lags), max(lags)
    yield Remark(
        Grade.CARE,
        f"the tracks drift: points are off by {lags[first]:.2f} px after {first} frame and by "
        f"{lags[last]:.2f} px after {last}; track-drift {in_force(run.messages, DRIFT) or 0:.2g} "
        f"and pixel-sigma {in_force(run.messages, PIXEL) or 0:.2g} px cover that",
    )


def _for_tracks(run: JudgedRun, known: Known) -> dict[str, str]:
    """Returns the settings that cover what the tracks show, where those of the run do not."""
    noise = known.noise
    if noise is None or not noise.drifts:
        return {}
    was = f"{in_force(run.messages, DRIFT) or 0.0:g}"
    told = noise.setting({DRIFT: was, "model": _model(run)})
    told = {} if told.get(DRIFT) == was else told
    pixel_px = in_force(run.messages, PIXEL)
    if (
        pixel_px
        and noise.stands_for_px > pixel_px
        and differs_clearly(noise.stands_for_px, pixel_px)
    ):
        told[PIXEL] = f"{noise.stands_for_px:.3g}"
    return told


def _model(run: JudgedRun) -> str:
    model = in_force(run.messages, "model")
    return "" if model is None else SETTINGS[IDS["model"]].words[int(model)]


def _halves(tuned: Tuned) -> Iterator[str]:
    """Yields what comparing halves of the points gave."""
    found = tuned.halves
    if found is None or not np.isfinite(found.before.ratio):
        return
    if not found.before.ratio > found.before.by_chance:
        yield "each half of the points alone leads where all of them lead"
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
    yield words


def of_calibration(found: CalibrationDoubts, own: Estimated | None = None) -> Iterator[Remark]:
    """Yields what images and twists show of the camera; `own` is the filter's estimate of it."""
    if found.scale is not None:
        yield from of_scale(found.scale)
    if own is not None:
        yield Remark(Grade.CARE if own.is_doubtful else Grade.GOOD, own.words())
    if found.turn is not None and not (own is not None and own.answers_turn):
        yield from of_turn(found.turn)


def of_turn(found: Turned) -> Iterator[Remark]:
    """Yields a remark on whether the camera's mounting is right."""
    if not found.is_off:
        return
    words = f"the camera looks {found.angle_deg:.1f} +- {found.sigma_deg:.1f} degrees beside where "
    words += "T_CB says, or the velocities are off across the way: positions may be off by "
    words += f"{found.beyond:.1%} of the way"
    words += f", for which {CAMERA_TURN} stands" if found.setting else ""
    yield Remark(Grade.CARE, f"{words}. Calibrate the camera's place on the body once more")


def of_scale(doubt: Doubt) -> Iterator[Remark]:
    """Yields a remark on how well the twists confirm the stereo scale."""
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
