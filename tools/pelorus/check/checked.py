# SPDX-License-Identifier: MIT
"""The whole of `pelorus check`: tuning, a run before and one after, and what they say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pelorus.check import changes
from pelorus.check.calibration import calibration
from pelorus.check.covering import CALIBRATE, covering
from pelorus.check.estimated import without_clock
from pelorus.check.halves_alike import with_halves_alike, with_shared_rows
from pelorus.check.held import held_against
from pelorus.check.known import Known
from pelorus.check.options import Settings, options_of
from pelorus.check.outcome import Bench
from pelorus.check.parameters import Tuned
from pelorus.check.tuning import tune
from pelorus.check.verdict import Grade, JudgedRun, Remark, Verdict, of_search, verdict_of
from pelorus.errors import PelorusError
from pelorus.evaluate.evaluation import judge
from pelorus.faults.named import judged_of
from pelorus.io.trajectory import Trajectory, truth_in
from pelorus.native.replay import Outputs, replay
from pelorus.program.console import step
from pelorus.wire import framing

SPELLS_SHOWN = 12
STEPS = 5
NAMED = "a fault is named first"
NOTHING_USED = "no frame could be used"  # words of pelorus-replay


@dataclass(frozen=True)
class Checked:
    """The result of a check.

    `verdict` is that with the written settings, `as_given` that with the given ones; `notes` are of
    the search. Each of `rows` is (title, before, after).
    """

    verdict: Verdict
    as_given: Verdict | None  # None: no frame was used, or a fault stands in the way
    notes: list[Remark]
    spells: list[str]
    changes: list[str]
    rows: list[tuple[str, str, str]]
    tuned: Tuned | None  # None where a fault must be mended first
    lines: tuple[str, ...] = ()  # of a config: the settings that should change

    @property
    def remarks(self) -> list[Remark]:
        """Returns the remarks of the run, and after them those of the search."""
        return [*self.verdict.remarks, *self.notes]

    @property
    def grade(self) -> Grade:
        """Returns the verdict's grade."""
        return self.verdict.grade

    @property
    def was(self) -> str:
        """Returns the verdict with the given settings, where that differs."""
        if self.tuned is None:
            return ""
        if self.as_given is None:
            return "with the settings as they are no frame can be used"
        if self.as_given.grade == self.verdict.grade:
            return ""
        return f"with the settings as they are: {self.as_given.words}"

    def next_step(self, tuned: Path) -> str:
        """Returns what to do next, in words."""
        if self.tuned is None:
            return f"mend this first, and convert again: {self.verdict.doubts[0].partition(':')[0]}"
        if not self.lines:
            return "nothing need be changed"
        return f"run with --config {tuned}, or set {'; '.join(self.lines)}"


def check(program: Path, recording: Path, given: Settings, folder: Path) -> Checked:
    """Tunes in the folder, then replays the whole recording with old and new settings."""
    step("faults of the recording")
    bench = Bench(program, recording, folder, given.get("process", ""))
    messages = framing.messages_of(recording)
    known = Known(judged_of(messages, bench.examined), None, bench.examined)
    if known.is_stopped:
        return Checked(verdict_of(None, known), None, [], [], [], [], None)
    step("noises, clock and biases")
    one_clock = all(fault.name != "clock-turns" for fault in known.faults)
    found = tune(bench, without_clock(given), known.judged.agreed, one_clock)
    if "calibrate" in given:
        found = replace(found, settings=found.settings | {"calibrate": given["calibrate"]})
    if any(fault.lasts for fault in known.faults):
        found.lasting.append(NAMED)
    known = replace(known, noise=found.noise)
    step("held against yours")
    tuned = held_against(bench, given, found)
    step("errors that points share")
    tuned = with_halves_alike(bench, with_shared_rows(bench, tuned))
    truth = truth_in(messages)
    step("the verdict")
    before = run = _whole(program, recording, given, folder, "before")
    if not bench.alike(given, tuned.settings):
        run = _whole(program, recording, tuned.settings, folder, "after")
    if run is None:
        raise PelorusError(f"{recording}: {NOTHING_USED}")
    figures = {} if before is None else _figures(before, truth)
    # Others, as a clock that is off, the search above has set already.
    estimable = [fault for fault in known.faults if CALIBRATE in fault.settings]
    asked = calibration(known.agreed, run.messages).settings | covering(run.messages, estimable)
    if asked:
        tuned = replace(tuned, settings=tuned.settings | asked)
        run = _whole(program, recording, tuned.settings, folder, "after") or run
    rows = [(title, figures.get(title, "-"), now) for title, now in _figures(run, truth).items()]
    cost = (
        "-2 ln likelihood an observation",
        f"{tuned.before.cost:.2f}",
        f"{tuned.after.cost:.2f}",
    )
    spells = [spell.words(run.origin_ns) for spell in run.health.spells]
    if len(spells) > SPELLS_SHOWN:
        spells = [*spells[:SPELLS_SHOWN], f"and {len(spells) - SPELLS_SHOWN} more: pelorus report"]
    notes = of_search(tuned)
    changed = given, bench.header, tuned, bench.by_imu
    verdict = verdict_of(run, known)
    as_given: Verdict | None = verdict
    if before is not run:
        as_given = None if before is None else verdict_of(before, known)
    return Checked(
        verdict,
        as_given,
        notes,
        spells,
        changes.changes(*changed),
        [cost, *rows],
        tuned,
        tuple(changes.lines(*changed)),
    )


def _whole(
    program: Path, recording: Path, settings: Settings, folder: Path, name: str
) -> JudgedRun | None:
    """Returns the replay of the whole recording; None if no frame could be used."""
    outputs = Outputs.named(folder, name)
    try:
        replay(program, recording, options_of(settings), outputs)
    except PelorusError as error:
        if NOTHING_USED in str(error):
            return None
        raise
    return JudgedRun.of(framing.messages_of(outputs.log))


def _figures(run: JudgedRun, truth: Trajectory | None) -> dict[str, str]:
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
    """Returns a settings file, with the findings as comments."""
    assert found.tuned is not None
    lines = [f"# pelorus check {recording.name}: {found.verdict.words}"]
    lines += [f"#   {words}" for words in found.verdict.doubts]
    lines += [f"# {change}" for change in found.changes]
    lines += [f"{name} = {value}" for name, value in found.tuned.settings.items()]
    return "\n".join(lines) + "\n"
