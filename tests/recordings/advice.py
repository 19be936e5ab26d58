# SPDX-License-Identifier: MIT
"""Does a user who follows `pelorus check` lose by it? Accuracy and consistency with the settings as
they are, and with those that `check` writes.

usage: advice.py [--bin build/bin] [--only TEXT] [--simulated N] [--seed S]

Real recordings are those of judge.py, with their settings. Simulated drives (everyday.py) have one
of the defects below, and are told noises that are 0.3 to 3 times the true ones, each by itself.

ATE      m; of 03 the RMS distance to the road
NEES/6   mean; 1 is expected
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/python"))

import everyday  # noqa: E402 - what the tests drive
import judge  # noqa: E402
from pelorus.check import checked  # noqa: E402
from pelorus.check.options import Settings, options_of  # noqa: E402
from pelorus.commands.choices import settings_given  # noqa: E402
from pelorus.io.recording import Recording  # noqa: E402
from pelorus.wire.layout import Floats  # noqa: E402

WRONG_MOST = 3.0  # times, either way
Chance = np.random.Generator
Defect = Callable[[Recording, Chance], Recording]


# --- defects --------------------------------------------------------------------------------------


def _lasting(count: int, columns: int, keeps: float, chance: Chance) -> Floats:
    """Returns noise of variance 1 that keeps the share `keeps` from one row to the next."""
    out = chance.normal(size=(count, columns))
    for k in range(1, count):
        out[k] = keeps * out[k - 1] + np.sqrt(1 - keeps**2) * out[k]
    return out


def _with_pixels(drive: Recording, off: Floats) -> Recording:
    pixels = drive.tracks.pixels + off
    return replace(drive, tracks=replace(drive.tracks, pixels=pixels))


def _by_track(drive: Recording, of: Callable[[Floats], Floats]) -> Recording:
    """Adds to the pixels of each track what `of` returns for its frames."""
    off = np.zeros_like(drive.tracks.pixels)
    for id in np.unique(drive.tracks.id):
        rows = np.nonzero(drive.tracks.id == id)[0]
        off[rows] = of(drive.tracks.pixels[rows])
    return _with_pixels(drive, off)


def none(drive: Recording, _: Chance) -> Recording:
    """Leaves the noise white."""
    return drive


def drifting(drive: Recording, chance: Chance) -> Recording:
    """Adds errors that keep nine tenths from frame to frame, like a drifting tracker's."""
    px = chance.uniform(0.5, 1.5)
    return _by_track(drive, lambda pixels: px * _lasting(len(pixels), 4, 0.9, chance))


def lagging(drive: Recording, _: Chance) -> Recording:
    """Biases matches: a tenth of a point's motion stays behind."""
    return _by_track(drive, lambda pixels: -0.1 * np.diff(pixels, axis=0, prepend=pixels[:1]))


def heavy(drive: Recording, chance: Chance) -> Recording:
    """Adds noise of Student's t with two degrees of freedom."""
    return _with_pixels(drive, 0.5 * chance.standard_t(2, drive.tracks.pixels.shape))


def bent(drive: Recording, chance: Chance) -> Recording:
    """Adds a lens error, which depends on the place in the picture."""
    x, y = (drive.tracks.pixels[:, :2] / (376, 240) - 1).T
    off = np.zeros_like(drive.tracks.pixels)
    off[:, 2] = chance.uniform(0.3, 1.0) * (1.5 * x * y + 0.5 * x)
    return _with_pixels(drive, off)


def wrong(drive: Recording, chance: Chance) -> Recording:
    """Makes one match in twenty another point."""
    off = chance.uniform(-40, 40, drive.tracks.pixels.shape) * [1, 0.05, 1, 0.05]
    off[chance.random(len(off)) > 0.05] = 0
    return _with_pixels(drive, off)


def by_speed(drive: Recording, chance: Chance) -> Recording:
    """Adds wheels' errors: 2 % of scale, and slip of 3 % of the speed that lasts for a second."""
    rate_hz = 1e9 / float(np.median(np.diff(drive.twist_t_ns)))
    slip = _lasting(len(drive.v_B_mps), 3, float(np.exp(-1 / rate_hz)), chance)
    speed = np.linalg.norm(drive.v_B_mps, axis=1, keepdims=True)
    return replace(drive, v_B_mps=1.02 * drive.v_B_mps + 0.03 * speed * slip)


def wandering(drive: Recording, chance: Chance) -> Recording:
    """Adds a gyro bias that walks, and velocities across the way that are off for seconds."""
    rate_hz = 1e9 / float(np.median(np.diff(drive.twist_t_ns)))
    keeps = float(np.exp(-1 / (3 * rate_hz)))
    v = 0.1 * _lasting(len(drive.v_B_mps), 3, keeps, chance) * [0, 1, 1]
    w = 0.005 * _lasting(len(drive.v_B_mps), 3, float(np.exp(-1 / (20 * rate_hz))), chance)
    return replace(drive, v_B_mps=drive.v_B_mps + v, w_B_radps=drive.w_B_radps + w)


DEFECTS: tuple[Defect, ...] = (
    none, drifting, lagging, heavy, bent, wrong, by_speed, wandering,
)  # fmt: skip


# --- drives ---------------------------------------------------------------------------------------


def simulated(count: int, first: int, folder: Path) -> Iterator[tuple[str, Path, Settings]]:
    """Yields name, recording, settings of simulated drives."""
    for seed in range(first, first + count):
        chance = np.random.default_rng([seed, 3])
        defect = DEFECTS[seed % len(DEFECTS)]
        drawn = replace(everyday.drawn(seed), told=1)
        path = folder / f"{seed}.plr"
        defect(everyday.drive(drawn, seed), chance).write(path)
        off = np.exp(chance.uniform(-1, 1, 3) * np.log(WRONG_MOST))
        true = (drawn.pixel_px, drawn.velocity_mps, drawn.gyro_radps)
        names = ("pixel-sigma", "velocity-sigma", "gyro-sigma")
        told = {n: f"{x * f:.3g}" for n, x, f in zip(names, true, off, strict=True)}
        yield f"{seed} {drawn.kind}, {defect.__name__}", path, told


def reals(folder: Path) -> Iterator[tuple[str, Path, Settings]]:
    """Yields name, recording, settings of real recordings."""
    for case in judge.cases():
        if not (judge.DATA / case.file).exists():
            continue
        words = dict(zip(case.options[::2], case.options[1::2], strict=True))
        config = words.pop("--config", None)
        given = settings_given(
            None if config is None else Path(config),
            [f"{name.removeprefix('--')}={value}" for name, value in words.items()],
        )
        yield case.name, judge.converted(case, folder), given


def main() -> int:
    """Prints the table, and the geometric means of the simulated drives."""
    parser = judge.parser_of(__doc__, "drives whose name contains it")
    parser.add_argument("--simulated", type=int, default=0)
    parser.add_argument("--seed", type=int, default=61000)
    given = parser.parse_args()
    given.cache.mkdir(exist_ok=True)
    program = given.bin / "pelorus-replay"
    ratios: list[float] = []
    print(
        "| recording | ATE | after `check` | NEES/6 | after `check` | |\n|---|---|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as scratch:
        some = simulated(given.simulated, given.seed, Path(scratch))
        for name, recording, settings in some if given.simulated else reals(given.cache):
            if given.only not in name:
                continue
            with tempfile.TemporaryDirectory() as folder:
                found = checked.check(program, recording, settings, Path(folder))
            if found.tuned is None:
                print(f"| {name} | | | | | {found.remarks[0].text} |", flush=True)
                continue
            both = [
                judge.figures(judge.run(program, recording, options_of(some)))
                for some in (settings, found.tuned.settings)
            ]
            ratios.append(both[1]["ATE"] / both[0]["ATE"])
            cells = [f"{one.get(k, np.nan):.3g}" for k in ("ATE", "NEES/6") for one in both]
            print(f"| {name} | {' | '.join(cells)} | {'; '.join(found.lines)} |", flush=True)
    if ratios:
        print(f"ATE after over before: {np.exp(np.mean(np.log(ratios))):.2f} (geometric mean)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
