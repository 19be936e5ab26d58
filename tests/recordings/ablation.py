# SPDX-License-Identifier: MIT
"""Leaves out each threshold of the supervisor, one after the other, and prints what it costs: on scenarios of
the campaign and on real recordings. docs/SUPERVISION.md shows the result.

usage: ablation.py [--bin build/bin] [--seeds 8] [--only NAME,...]

A scenario counts where its verdict turns, or its error, its own sigma, the share GOOD or the silent share
changes by more than chance does over these seeds; a recording where its ATE changes by a tenth, or a share by
five hundredths.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from judge import ROOT, cases, converted, figures, run

SCENARIOS = (
    "mc-default-bias,fast,far,wrong-20,lost-1,isotropic,alternate,slip-0.25,slip-0.5,slip-2,slip-0.5-far,"
    "dead-wheels,dead-gyro,gyro-0.5,slip-2-few,frozen-0.2,jump-body-1,jump-body-2-wrong,camera-back-1,"
    "jump-camera-1,scene-0.3,convoy-60,late-5ms,wayout-swapped"
)
ROW = re.compile(
    r"^(\S*)\s+(nominal|before|event|after)\s+[\d.infa]+\+-\s*[\d.infa]+\s*[\d.infe+]+\s+[\d.infe+]+\s+"
    r"([\d.]+)\s+[\d.]+\s+([\d.]+)\s+([\d.e+-]+)\s+([\d.e+-]+)"
)


def campaign(program: Path, seeds: int, without: str) -> dict[str, tuple[bool, dict[str, tuple[float, ...]]]]:
    """Verdict, and for each phase GOOD, silent, error and own sigma."""
    command = [str(program), "--seeds", str(seeds), "--jobs", "1", "--scenario", SCENARIOS]
    command += ["--without", without] if without else []
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found: dict[str, tuple[bool, dict[str, tuple[float, ...]]]] = {}
    name, phases = "", {}
    for line in text.splitlines():
        if match := ROW.match(line):
            if match.group(1):
                name, phases = match.group(1), {}
            phases[match.group(2)] = tuple(float(match.group(k)) for k in range(3, 7))
        elif line.startswith(("  pass", "  FAIL")):
            found[name] = (line.startswith("  pass"), phases)
    return found


def scenario_changes(whole: dict, without: dict) -> list[str]:
    said = []
    for name, (passed, phases) in whole.items():
        passes, others = without[name]
        words = [] if passed == passes else ["fails" if passed else "passes"]
        for phase, (good, silent, error, own) in phases.items():
            good2, silent2, error2, own2 = others.get(phase, (0.0,) * 4)
            if abs(error2 - error) > max(0.3 * error, 0.05):
                words.append(f"error {error:.2g} -> {error2:.2g} m")
            elif own2 > 1.6 * own or own2 < own / 1.6:
                words.append(f"own sigma {own:.2g} -> {own2:.2g} m")
            if abs(good2 - good) > 0.05:
                words.append(f"GOOD {good:.2f} -> {good2:.2f}")
            if abs(silent2 - silent) > 0.005:
                words.append(f"silent {silent:.3f} -> {silent2:.3f}")
        if words:
            said.append(f"`{name}` {', '.join(dict.fromkeys(words))}")
    return said


def recordings(program: Path, cache: Path, without: str) -> dict[str, dict[str, float]]:
    found = {}
    for case in cases():
        if not (case.name.endswith(", default") and "klt" in case.name) and "tum" not in case.name:
            options = [*case.options, *(["--without", without] if without else [])]
            found[case.name] = figures(run(program, converted(case, cache), options))
    return found


def recording_changes(whole: dict, without: dict) -> list[str]:
    said = []
    for name, f in whole.items():
        g, words = without[name], []
        if "ATE" in f and abs(g["ATE"] - f["ATE"]) > 0.1 * f["ATE"]:
            words.append(f"ATE {f['ATE']:.3g} -> {g['ATE']:.3g} m")
        if "err0" in f and abs(g["err0"] - f["err0"]) > 0.5 * f["err0"]:
            words.append(f"err0 {f['err0']:.3g} -> {g['err0']:.3g} m")
        for key, word in (("good", "GOOD"), ("silent", "silent")):
            if key in f and abs(g[key] - f[key]) > 0.05:
                words.append(f"{word} {f[key]:.2f} -> {g[key]:.2f}")
        if words:
            said.append(f"{name}: {', '.join(words)}")
    return said


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, default=ROOT / "build/bin")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--only", default="")
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "pelorus-recordings")
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program, replay = given.bin / "pelorus-campaign", given.bin / "pelorus-replay"
    listed = subprocess.run([str(program), "--limits"], capture_output=True, text=True, check=True).stdout
    names = [line.split()[0] for line in listed.splitlines()]
    whole, real = campaign(program, given.seeds, ""), recordings(replay, given.cache, "")
    for name in given.only.split(",") if given.only else names:
        simulated = scenario_changes(whole, campaign(program, given.seeds, name))
        measured = recording_changes(real, recordings(replay, given.cache, name))
        print(f"| {name} | {'; '.join(simulated) or '-'} | {'; '.join(measured) or '-'} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
