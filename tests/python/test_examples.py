# SPDX-License-Identifier: MIT
"""The programs of examples/: each is compiled as a user does, and run."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
# A board for mcu_main.c: it stands for two seconds, then drives 1 m/s ahead; every hundredth
# reading comes behind its frame.
BOARD = """
#include <stdio.h>
#include "pelorus/pelorus.h"
typedef struct stamped_imu { plr_time_ns t_ns; plr_imu reading; } stamped_imu;
static unsigned readings, frames, asked;
static double ahead(double t) {
    return t < 2 ? 0 : t < 4 ? 0.25 * (t - 2) * (t - 2) : t - 3;
}
const stamped_imu *board_imu(void) {
    static stamped_imu now;
    const double t = readings * 0.005;
    if (readings % 100 == 99 && asked++ % 3 != 2)
        return NULL;
    now.t_ns = readings * 5000000ULL;
    now.reading = (plr_imu){{t >= 2 && t < 4 ? 0.5 : 0, 0, 9.81}, {0, 0, 1e-4 * (readings % 3)}};
    return &now;
}
void board_imu_done(void) { readings++; }
const plr_frame *board_frame(void) {
    static plr_observation seen[12];
    static plr_frame frame;
    const double x = ahead(frames * 0.1);
    for (unsigned i = 0; i < 12; i++) {
        const double depth = 9 + 0.6 * i - x, right = (i % 2 ? -1 : 1) * (0.4 + 0.2 * i);
        const double u = 320 + 450 * right / depth, v = 240 + 450 * (0.1 * (i % 7) - 0.3) / depth;
        const float uR = (float)(u - 450 * 0.12 / depth);
        seen[i] = (plr_observation){i, (float)u, (float)v, uR, (float)v, 0};
    }
    frame = (plr_frame){frames * 100000000ULL, PLR_NO_BUDGET, 12, seen};
    return &frame;
}
void board_frame_done(void) { frames++; }
bool board_answer(const plr_filter *filter, const plr_report *report) {
    plr_pose pose;
    plr_totals totals;
    if (frames < 60)
        return true;
    const plr_status status = plr_filter_pose(filter, &pose);
    (void)plr_filter_totals(filter, &totals);
    printf("%s, x = %.2f m, %u used, %u late\\n", plr_status_text(status), pose.p[0], report->used,
           (unsigned)totals.late);
    return false;
}
"""


def flags() -> list[str]:
    """What the built library was compiled with, as its users must be."""
    told = BIN.parent / "pelorus.pc"
    if not told.is_file():
        pytest.skip(f"{told} is not built")
    (found,) = re.findall(r"^Cflags: -I\S+ (.*)$", told.read_text(), re.MULTILINE)
    return shlex.split(found)


def compiled(folder: Path, *sources: Path) -> str:
    """What the program prints."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    program = folder / "program"
    words = ("-std=c99", "-O1", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror")
    command = [compiler, *words, *flags(), f"-I{ROOT / 'include'}", *map(str, sources)]
    subprocess.run([*command, str(BIN.parent / "libpelorus.a"), "-o", str(program)], check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_program_with_an_imu_finds_where_it_went(tmp_path: Path) -> None:
    said = compiled(tmp_path, EXAMPLES / "with_imu.c")
    x, variance, health = re.findall(r"^x = (\S+) m, variance (\S+) m\^2, (\w+)$", said)[0]
    assert float(x) == pytest.approx(5.0, abs=0.05)
    assert 1e-5 < float(variance) < 0.05
    assert health == "good"


def test_the_loop_of_a_controller_waits_for_the_imu_and_loses_no_frame(tmp_path: Path) -> None:
    board = tmp_path / "board.c"
    board.write_text(BOARD)
    said = compiled(tmp_path, EXAMPLES / "mcu_main.c", board)
    assert said.startswith("good, x = 2.9")
    assert said.endswith(", 12 used, 0 late\n")


def test_the_loop_of_a_controller_compiles_for_one() -> None:
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None:
        pytest.skip("no arm-none-eabi-gcc")
    words = "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -O2 -ffp-contract=off"
    command = [compiler, *words.split(), "-fno-math-errno", "-DPLR_MAX_LANDMARKS=16", "-Werror"]
    source = EXAMPLES / "mcu_main.c"
    subprocess.run([*command, f"-I{ROOT / 'include'}", "-c", source, "-o", os.devnull], check=True)


def test_in_the_dark_the_wheels_keep_the_robot_on_its_way() -> None:
    def off_m(*words: str) -> dict[int, tuple[float, float]]:
        command = [sys.executable, str(EXAMPLES / "wheels_and_imu.py"), *words]
        there = os.environ | {"PELORUS_BIN": str(BIN)}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=there)
        found = re.findall(r"(\d+) s .* off (\S+) m, sigma (\S+) m", done.stdout)
        return {int(t): (float(off), float(sigma)) for t, off, sigma in found}

    by_wheels, alone = off_m(), off_m("--no-wheels")
    assert len(by_wheels) == len(alone) == 31
    assert by_wheels[25][0] < 0.02 * 8.0, "8 m in the dark"
    assert by_wheels[25][1] < 0.5 * alone[25][1]
    assert all(off < 3 * sigma + 0.01 for off, sigma in by_wheels.values())
