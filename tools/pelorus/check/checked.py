# SPDX-License-Identifier: MIT
"""The whole of `pelorus check`: tuning, a run before and one after, and what they say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pelorus import wire
from pelorus.check import verdict, wheels
from pelorus.check.calibration import calibration
from pelorus.check.estimated import estimated, without_clock
from pelorus.check.halves_alike import with_halves_alike
from pelorus.check.held import held_against
from pelorus.check.options import Settings, options_of
from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned
from pelorus.check.shared_rows import with_shared_rows
from pelorus.check.tuning import tune
from pelorus.check.verdict import Grade, Remark, Run
from pelorus.console import progress
from pelorus.errors import PelorusError
from pelorus.evaluation import judge
from pelorus.faults.mend import BEHIND, CANNOT, known_words
from pelorus.faults.named import judged_of
from pelorus.replay import Outputs, replay
from pelorus.trajectory import Trajectory, truth_in

SPELLS_SHOWN = 12
NAMED = "a fault is named first"
NOTHING_USED = "no frame could be used"  # words of pelorus-replay


@dataclass(frozen=True)
class Checked:
    """`rows`: title, before, after."""

    grade: Grade
    remarks: list[Remark]
    spells: list[str]
    changes: list[str]
    rows: list[tuple[str, str, str]]
    tuned: Tuned | None  # None where a fault must be mended first
    share: float = 0.0  # of the way, by which positions may be off, if more than was given
    lines: tuple[str, ...] = ()  # of a config: what should be set otherwise

    def next_step(self, tuned: Path) -> str:
        """What to do now."""
        if self.tuned is None:
            worst = max(self.remarks, key=lambda remark: remark.grade)
            return f"mend this first, and convert again: {worst.text.partition(':')[0]}"
        if not self.lines:
            return "nothing need be changed"
        return f"run with --config {tuned}, or set {'; '.join(self.lines)}"

    @property
    def verdict(self) -> str:
        """No better than what the drive can tell."""
        words = verdict.VERDICTS[self.grade]
        told = self.share > 0 and self.grade is not Grade.BAD
        return f"{words}, to {self.share:.1%} of the way" if told else words


def check(program: Path, recording: Path, given: Settings, folder: Path) -> Checked:
    """Tune in the folder, then replay the whole recording with both settings."""
    bench = Bench(program, recording, folder, given.get("process", ""))
    messages = wire.messages_of(recording)
    judged = judged_of(messages, bench.examined)
    named = judged.faults
    faults = [Remark(Grade.BAD if f.grave else Grade.CARE, f.told) for f in named]
    if any(fault.stops for fault in named):
        known = BEHIND if judged.agreed is None else f"{known_words(judged.agreed)}; {CANNOT}"
        faults.append(Remark(Grade.CARE, known))
        return Checked(Grade.BAD, faults, [], [], [], None)
    one_clock = all(fault.name != "clock-turns" for fault in named)
    found = tune(bench, without_clock(given), one_clock)
    if "calibrate" in given:
        found = replace(found, settings=found.settings | {"calibrate": given["calibrate"]})
    if any(fault.lasts for fault in named):
        found.lasting.append(NAMED)
    tuned = held_against(bench, given, found)
    tuned = with_halves_alike(bench, with_shared_rows(bench, tuned))
    truth = truth_in(messages)
    both = progress((("before", given), ("after", tuned.settings)), "whole drive")
    before, run = (_whole(program, recording, settings, folder, name) for name, settings in both)
    if run is None:
        raise PelorusError(f"{recording}: {NOTHING_USED}")
    figures = {} if before is None else _figures(before, truth)
    views = None if bench.by_imu else judged.views
    camera = calibration(bench.examined, views, run.messages)
    if camera.settings:  # no estimate changes by it, and each covariance
        tuned = replace(tuned, settings=tuned.settings | camera.settings)
        run = _whole(program, recording, tuned.settings, folder, "after") or run
    origin = int(run.frames.t_ns[0])
    own = estimated(run.messages, camera)
    remarks = [*faults, *verdict.remarks(run, tuned, origin), *verdict.of_calibration(camera, own)]
    rows = [(title, figures.get(title, "-"), now) for title, now in _figures(run, truth).items()]
    cost = (
        "-2 ln likelihood an observation",
        f"{tuned.before.cost:.2f}",
        f"{tuned.after.cost:.2f}",
    )
    spells = [spell.words(origin) for spell in run.health.spells]
    if len(spells) > SPELLS_SHOWN:
        spells = [*spells[:SPELLS_SHOWN], f"and {len(spells) - SPELLS_SHOWN} more: pelorus report"]
    changed = verdict.changes(given, bench.header, tuned, bench.by_imu)
    if judged.agreed is not None:
        words = f"{known_words(judged.agreed)}; {CANNOT}"
        remarks.append(Remark(Grade.GOOD, words))
    if bench.by_imu:
        remarks += wheels.remarks(program, messages, tuned.settings)
    grade = verdict.overall(remarks)
    lines = tuple(verdict.lines(given, bench.header, tuned, bench.by_imu))
    return Checked(grade, remarks, spells, changed, [cost, *rows], tuned, camera.share, lines)


def _whole(
    program: Path, recording: Path, settings: Settings, folder: Path, name: str
) -> Run | None:
    """None if not one frame could be used, as with a clock that is off."""
    outputs = Outputs.named(folder, name)
    try:
        replay(program, recording, options_of(settings), outputs)
    except PelorusError as error:
        if NOTHING_USED in str(error):
            return None
        raise
    return Run.of(wire.messages_of(outputs.log))


def _figures(run: Run, truth: Trajectory | None) -> dict[str, str]:
    found = {
        "innovations over their noise": f"{run.nis:.2f}",
        "matches rejected": f"{run.gated_share:.1%}",
        "frames good": f"{run.good_share:.1%}",
    }
    if truth is None:
        return found
    against = judge(run.messages, truth, [])
    for title, key in (("ATE m (truth, to compare)", "ate_m"), ("NEES/6", "nees_per_dof")):
        value = against[key]
        found[title] = "-" if value is None else f"{value:.3f}"
    return found


def config_text(found: Checked, recording: Path) -> str:
    """A settings file, with what was found as its remarks."""
    assert found.tuned is not None
    lines = [f"# pelorus check {recording.name}: {found.verdict}"]
    lines += [f"#   {remark.text}" for remark in found.remarks if remark.grade > Grade.GOOD]
    lines += [f"# {change}" for change in found.changes]
    lines += [f"{name} = {value}" for name, value in found.tuned.settings.items()]
    return "\n".join(lines) + "\n"
