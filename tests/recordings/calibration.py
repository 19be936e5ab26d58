# SPDX-License-Identifier: MIT
"""A calibration that is nearly right, on the simulator's recordings with an IMU: how far off the
filter is that estimates it, beside one that knows it.

usage: calibration.py [--bin build/bin] [--only TEXT] [--f64] [--seeds 5] [--calibrate LIST]
                      [-- REPLAY OPTIONS]

The HEADER is told what is wrong; pixels and ids are drawn anew for each seed, and the figures are
medians. `known` is the true calibration, taken for exact: all others are compared with it. With
`--calibrate off` nothing is estimated, and the same sigmas are taken into account.

err0     m, as `pelorus evaluate` has it; ratio: beside `known`
NEES/6   mean; 1 is expected
good     share of the frames GOOD
focal, baseline, turn, clock: what is left of each error, %, %, deg, ms
sigmas   the largest of all estimated errors in its own sigmas
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from judge import Case, conf, converted, figures, parser_of, run
from pelorus.math import se3
from pelorus.wire.calibrated import PARTS, last_calibrated
from pelorus.wire.frames import End, Header, Message, Stereo, Truth
from pelorus.wire.framing import messages_of, write_file
from pelorus.wire.layout import Floats
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

DRIVES = ("udel_gore_zupt", "tum_corridor1")
EXACT = ("focal", "baseline", "camera-turn")
TURN_RAD = np.radians(0.3) / np.sqrt(3) * np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Wrong:
    """The HEADER's errors of focal length, baseline and T_CB, and that of the frames' clock."""

    focal: float = 0.0
    baseline: float = 0.0
    turned: float = 0.0  # share of TURN_RAD
    late_s: float = 0.0

    def header(self, header: Header) -> Header:
        camera = header.camera
        told = replace(
            camera,
            fx_px=camera.fx_px * (1 + self.focal),
            fy_px=camera.fy_px * (1 + self.focal),
            baseline_m=camera.baseline_m * (1 + self.baseline),
        )
        turn = se3.exp(np.zeros(3), self.turned * TURN_RAD).R
        R, t = np.asarray(header.R_CB), np.asarray(header.t_CB_m)
        return replace(header, camera=told, R_CB=turn @ R, t_CB_m=turn @ t)

    def message(self, message: Message) -> Message:
        if isinstance(message, Header):
            return self.header(message)
        if isinstance(message, Stereo):
            return replace(message, t_ns=message.t_ns + round(self.late_s * 1e9))
        return message

    def expected(self) -> Floats:
        """Returns the corrections that are expected of the filter: plr_calibration_error."""
        out = np.zeros(len(PARTS))
        out[:2] = 1 / (1 + self.baseline) - 1, 1 / (1 + self.focal) - 1
        out[2:5] = -self.turned * TURN_RAD
        out[-1] = -self.late_s
        return out


ALL = Wrong(focal=0.005, baseline=-0.005, turned=1.0, late_s=0.005)
CASES: dict[str, Wrong] = {
    "known": Wrong(),
    "nothing": Wrong(),
    "focal +0.5 %": Wrong(focal=0.005),
    "focal -1 %": Wrong(focal=-0.01),
    "turned 0.3 deg": Wrong(turned=1.0),
    "baseline +0.5 %": Wrong(baseline=0.005),
    "5 ms late": Wrong(late_s=0.005),
    "all at once": ALL,
}
SIGMAS = ("--focal-sigma", "0.005", "--baseline-sigma", "0.005", "--camera-turn-sigma", "0.005")
CLOCK = ("--camera-clock-sigma", "0.005")
LIST = "focal,baseline,turn,clock"
COLUMNS = ("err0", "ratio", "NEES/6", "good", "focal", "baseline", "turn", "clock", "sigmas")


def later_truth(messages: list[Message], late_s: float) -> list[Message]:
    """Returns the truth at the frames' new times: between poses the walk is no straight line."""
    truth = [m for m in messages if isinstance(m, Truth)]
    t_ns = np.array([m.t_ns for m in truth])
    seconds = (t_ns - t_ns[0]) * 1e-9
    p = CubicSpline(seconds, [m.p_WB_m for m in truth])(seconds + late_s)
    turn = RotationSpline(seconds, Rotation.from_matrix([m.R_WB for m in truth]))
    R = turn(seconds + late_s).as_matrix()
    moved = (t_ns + round(late_s * 1e9)).tolist()
    others = [m for m in messages if not isinstance(m, Truth)]
    return others + [Truth(t, R[k], p[k]) for k, t in enumerate(moved)]


def spoiled(recording: Path, wrong: Wrong, folder: Path) -> Path:
    """Returns the recording with another HEADER and other times of its frames."""
    out = folder / f"{recording.stem}-{abs(hash(wrong))}.plr"
    given = [m for m in messages_of(recording) if not isinstance(m, End)]
    messages = later_truth([wrong.message(m) for m in given], wrong.late_s)
    messages.sort(key=lambda m: getattr(m, "t_ns", 0))
    write_file(out, messages, len(messages))
    return out


def options_of(name: str, listed: str) -> list[str]:
    """Returns options: `known` is exact; others have the same sigmas, estimated or considered."""
    if name == "known":
        exact = [v for part in EXACT for v in (f"--{part}-sigma", "0")]
        return [*conf("imu"), "--calibrate", "off", *exact]
    clock = () if listed == "off" else CLOCK
    return [*conf("imu"), *SIGMAS, *clock, "--calibrate", listed, "--twist-delay", "0.1"]


def row_of(messages: list[Message], wrong: Wrong) -> list[float]:
    """Returns err0, NEES/6, rotation and its sigma, and the errors of the calibration.

    These are what is left of focal, baseline, turn and clock, and the largest of all in its own
    sigmas.
    """
    found = figures(messages)
    row = [found["err0"], found["NEES/6"], found["good"]]
    told = last_calibrated(messages)
    if told is None:
        return row + [np.nan] * 5
    error = told.corrected - wrong.expected()
    bits = [bool(told.estimated >> k & 1) for k in range(len(PARTS))]
    left = np.where(bits, np.abs(error) * [part.scale for part in PARTS], np.nan)
    ratio = np.abs(error[bits]) / told.sigma[bits]
    return [*row, left[1], left[0], np.linalg.norm(left[2:5]), left[-1], float(ratio.max())]


def main() -> int:
    """Prints the table."""
    parser = parser_of(__doc__, "cases whose name contains it")
    parser.add_argument("--f64", action="store_true")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--calibrate", default=LIST, help="the setting")
    parser.add_argument("options", nargs="*")
    given = parser.parse_args()
    program = given.bin / ("pelorus-replay-f64" if given.f64 else "pelorus-replay")
    print(f"{'':31}" + "".join(f"{name:>9}" for name in COLUMNS))
    for drive in DRIVES:
        known: list[float] = []
        for name, wrong in CASES.items():
            if given.only not in name and name != "known":
                continue
            rows = []
            for seed in range(1, given.seeds + 1):
                case = Case(drive, f"imu/{drive}-60-seed0.npz", ("imu-npz", "--seed", str(seed)))
                folder = given.cache / f"seed{seed}"
                folder.mkdir(exist_ok=True, parents=True)
                recording = converted(case, folder)
                if wrong != Wrong():
                    recording = spoiled(recording, wrong, folder)
                options = [*options_of(name, given.calibrate), *given.options]
                rows.append(row_of(run(program, recording, options), wrong))
            median = np.median(rows, axis=0).tolist()
            known = known or median
            median.insert(1, median[0] / known[0])
            print(f"{drive:15}{name:16}" + "".join(f"{x:9.3g}" for x in median), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
