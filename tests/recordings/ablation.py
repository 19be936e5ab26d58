# SPDX-License-Identifier: MIT
"""Leaves out each threshold of the supervisor, one after the other, and prints what it costs: on
scenarios of the campaign and on real recordings. docs/SUPERVISION.md rests on it.

usage: ablation.py [--bin build/bin] [--seeds 8] [--only NAME,...]

A scenario counts where its verdict turns, or its error, its own sigma, the share GOOD or the silent
share changes by more than chance does over these seeds; a recording where its ATE changes by a
tenth, or a share by five hundredths.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from judge import Figures, cases, converted, figures, parser_of, run

SCENARIOS = (
    "mc-default-bias,fast,far,wrong-20,lost-1,isotropic,alternate,slip-0.25,slip-0.5,slip-2,"
    "slip-0.5-far,dead-wheels,dead-gyro,gyro-0.5,slip-2-few,frozen-0.2,jump-body-1,"
    "jump-body-2-wrong,camera-back-1,jump-camera-1,scene-0.3,convoy-60,late-5ms,wayout-swapped"
)
# name, phase, NEES, its error, max, d; then GOOD, beyond, silent, error, own sigma
PHASE = re.compile(r"^(\S*)\s+(nominal|before|event|after)\s+\S+\+-")
Phases = dict[str, tuple[float, ...]]
Outcomes = dict[str, tuple[bool, Phases]]


def campaign(program: Path, seeds: int, without: str) -> Outcomes:
    """Returns by scenario the verdict, and for each phase GOOD, silent, error and own sigma."""
    command = [str(program), "--seeds", str(seeds), "--jobs", "1", "--scenario", SCENARIOS]
    command += ["--policy", "own"]
    command += ["--without", without] if without else []
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: Outcomes = {}
    name = ""
    phases: Phases = {}
    for line in text.splitlines():
        if match := PHASE.match(line):
            if match.group(1):
                name, phases = match.group(1), {}
            good, _, silent, error, own, *_ = (float(x) for x in line.split()[-7:])
            phases[match.group(2)] = (good, silent, error, own)
        elif line.startswith(("  pass", "  FAIL")):
            found[name] = (line.startswith("  pass"), phases)
    return found


def _scenario_words(phases: Phases, others: Phases) -> list[str]:
    words = []
    for phase, (good, silent, error, own) in phases.items():
        good2, silent2, error2, own2 = others[phase]
        if abs(error2 - error) > max(0.3 * error, 0.05):
            words.append(f"error {error:.2g} -> {error2:.2g} m")
        elif own2 > 1.6 * own or own2 < own / 1.6:
            words.append(f"own sigma {own:.2g} -> {own2:.2g} m")
        if abs(good2 - good) > 0.05:
            words.append(f"GOOD {good:.2f} -> {good2:.2f}")
        if abs(silent2 - silent) > 0.005:
            words.append(f"silent {silent:.3f} -> {silent2:.3f}")
    return words


def scenario_changes(whole: Outcomes, without: Outcomes) -> list[str]:
    """Returns a phrase for each scenario that changes."""
    said = []
    for name, (passed, phases) in whole.items():
        passes, others = without[name]
        turned = [] if passed == passes else ["fails" if passed else "passes"]
        words = turned + _scenario_words(phases, others)
        if words:
            said.append(f"{name} {', '.join(dict.fromkeys(words))}")
    return said


def recordings(program: Path, cache: Path, without: str) -> dict[str, Figures]:
    """Returns the figures of each recording but those of a simulator."""
    found = {}
    for case in cases():
        if "tum" not in case.name and "udel" not in case.name:
            options = [*case.options, *(["--without", without] if without else [])]
            found[case.name] = figures(run(program, converted(case, cache), options))
    return found


def recording_changes(whole: dict[str, Figures], without: dict[str, Figures]) -> list[str]:
    """Returns a phrase for each recording that changes."""
    limits = {"ATE": (0.1, 0.0), "err0": (0.5, 0.0), "good": (0.0, 0.05), "silent": (0.0, 0.05)}
    said = []
    for name, f in whole.items():
        words = [
            f"{key} {f[key]:.3g} -> {without[name][key]:.3g}"
            for key, (share, step) in limits.items()
            if key in f and abs(without[name][key] - f[key]) > share * f[key] + step
        ]
        if words:
            said.append(f"{name}: {', '.join(words)}")
    return said


def main() -> int:
    """Prints a row for each threshold."""
    parser = parser_of(__doc__, "thresholds, by name")
    parser.add_argument("--seeds", type=int, default=8)
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program, replay = given.bin / "pelorus-campaign", given.bin / "pelorus-replay"
    listed = subprocess.run([str(program), "--limits"], capture_output=True, text=True, check=True)
    names = [line.split()[0] for line in listed.stdout.splitlines()]
    whole, real = campaign(program, given.seeds, ""), recordings(replay, given.cache, "")
    for name in given.only.split(",") if given.only else names:
        simulated = scenario_changes(whole, campaign(program, given.seeds, name))
        measured = recording_changes(real, recordings(replay, given.cache, name))
        print(f"| {name} | {'; '.join(simulated) or '-'} | {'; '.join(measured) or '-'} |")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
