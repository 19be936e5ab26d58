# SPDX-License-Identifier: MIT
"""Clocks that start again at 0, readings that share a stamp, several sensors in one file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus.converters.columns import Columns
from pelorus.io import stamps
from pelorus.io.foreign import ForeignFileError
from pelorus.io.table import Table

NAMES = "ax=fx:m/s2,ay=fy:m/s2,az=fz:m/s2,wx=gx:rad/s,wy=gy:rad/s,wz=gz:rad/s"
RATE_HZ, COUNT = 250, 1000
Floats = NDArray[np.float64]


def readings(seed: int = 4) -> Floats:
    """(COUNT, 6) of an IMU that is turned to and fro."""
    t = np.arange(COUNT)[:, None] / RATE_HZ
    smooth = np.sin(t * np.array([1.0, 1.3, 0.7, 2.1, 1.7, 0.9]))
    smooth[:, 2] += 9.8
    return np.asarray(smooth + np.random.default_rng(seed).normal(0, 0.02, smooth.shape))


def written(folder: Path, time: str, rows: list[tuple[object, ...]], more: str = "") -> Path:
    lines = [f"{time},{more}fx,fy,fz,gx,gy,gz", *(",".join(map(str, row)) for row in rows)]
    path = folder / "imu.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def read(path: Path, time: str, *rows: str) -> tuple[Table, list[str]]:
    columns = Columns.of([f"{NAMES},imu.t={time}"], rows=rows)
    table = columns.read(path, "imu")
    table.leave_out_bad("ax_mps2", "wx_radps")
    return table, columns.remarks


@pytest.mark.parametrize(
    ("bits", "unit", "unit_ns"), [(32, "us", 1000), (32, "ms", 10**6), (24, "us", 1000)]
)
def test_a_counter_that_starts_again_is_unwrapped_and_that_is_told(
    bits: int, unit: str, unit_ns: int, tmp_path: Path
) -> None:
    true = np.arange(COUNT) * (10**9 // RATE_HZ // unit_ns) + (1 << bits) - COUNT
    rows = [(int(t) % (1 << bits), *a) for t, a in zip(true, readings().round(4), strict=True)]
    table, remarks = read(written(tmp_path, "clock", rows), f"clock:{unit}")
    assert table.ascending_times().tolist() == (true * unit_ns).tolist()
    told = f"its clock of {bits} bits of {unit} starts again at 0 once: unwrapped"
    assert [told in remark for remark in remarks] == [True]


def test_a_clock_that_was_set_back_by_anything_else_is_no_counter() -> None:
    t_ns = np.concatenate((np.arange(100), np.arange(40, 140))) * 5_000_000
    assert stamps.unwrapped(t_ns) == (t_ns, 0, 0, "")
    assert not stamps.unwrapped(np.arange(100) * 5_000_000).wraps
    late = np.array([2**32 - 8000, 2**32 - 4000, 700_000_000, 700_004_000]) * 1000
    assert not stamps.unwrapped(late).wraps  # it starts again, and 700 s later
    shuffled = np.random.default_rng(1).permutation(np.arange(160) * 100_000_000)
    assert not stamps.unwrapped(shuffled).wraps
    assert not stamps.unwrapped(np.tile(np.arange(60) * 100_000_000, 9)).wraps


@pytest.mark.parametrize("batch", [2, 7, 16])
def test_readings_that_share_a_stamp_are_spread_over_their_interval(
    batch: int, tmp_path: Path
) -> None:
    true = (np.arange(COUNT) + 1) * 4_000_000
    stamped = true[np.minimum(np.arange(COUNT) // batch * batch + batch - 1, COUNT - 1)]
    rows = [(int(t), *a) for t, a in zip(stamped, readings().round(4), strict=True)]
    table, remarks = read(written(tmp_path, "t_ns", rows), "t_ns")
    off = np.abs(table.ascending_times() - true)
    assert off.max() <= 1
    assert f"{batch} readings have one time (the median): spread over the time" in remarks[0]


def test_batches_behind_a_pause_keep_their_rate() -> None:
    stamped = np.repeat(np.array([10, 20, 30, 230, 240]) * 1_000_000, 5)
    found = stamps.spread(stamped)
    assert found.batch == 5
    assert np.diff(found.t_ns).min() == 2_000_000
    assert found.t_ns[15] == 222_000_000


def test_rows_that_stand_twice_are_no_batch(tmp_path: Path) -> None:
    a = readings().round(4)
    rows = [(4_000_000 * (k // 2 + 1), *a[k // 2]) for k in range(COUNT)]
    table, remarks = read(written(tmp_path, "t_ns", rows), "t_ns")
    assert table.count == COUNT // 2
    assert any(f"{COUNT // 2} rows stand twice: left out" in remark for remark in remarks)


def of_several(instances: tuple[str, ...], unlike: float) -> list[tuple[object, ...]]:
    bias = np.random.default_rng(1).normal(0, unlike, (len(instances), 6))
    return [
        (4000 * (k + 1), name, *(a + bias[i]).round(4))
        for k, a in enumerate(readings())
        for i, name in enumerate(instances)
    ]


@pytest.mark.parametrize("instances", [("0", "1", "2"), ("5", "9"), ("icm", "bmi")])
def test_of_several_sensors_in_a_file_the_first_is_taken_and_another_by_name(
    instances: tuple[str, ...], tmp_path: Path
) -> None:
    rows = of_several(instances, 0.05)
    path = written(tmp_path, "TimeUS", rows, more="which,")
    first = sorted(instances)[0]
    table, remarks = read(path, "TimeUS:us")
    assert table.count == COUNT
    assert set(table.cells("which")) == {first}
    assert f"of {len(instances)} sensors, which the column which tells apart" in remarks[0]
    assert f"{first} is taken. Another: --rows which=" in remarks[0]
    table, remarks = read(path, "TimeUS:us", f"imu.which={instances[1]}")
    assert set(table.cells("which")) == {instances[1]}
    assert not remarks
    with pytest.raises(ForeignFileError, match="no row has which = 77; there are"):
        read(path, "TimeUS:us", "which=77")


def test_several_sensors_that_no_column_tells_apart_are_refused(tmp_path: Path) -> None:
    rows = [(t, *a) for t, _, *a in of_several(("0", "1"), 0.3)]
    with pytest.raises(ForeignFileError, match="2 rows have one time and differ as those of 2"):
        read(written(tmp_path, "TimeUS", rows), "TimeUS:us")


def test_columns_that_tell_their_units_need_no_mapping(tmp_path: Path) -> None:
    path = tmp_path / "imu.csv"
    names = [f"{kind}_RS_S_{axis}" for kind in "wa" for axis in "xyz"]
    units = ["rad s^-1"] * 3 + ["m s^-2"] * 3
    head = ",".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
    path.write_text(f"#timestamp [ns],{head}\n1520530308199447626,1,2,3,4,5,6\n")
    table = Columns.of([]).read(path, "imu")
    assert table.times().tolist() == [1520530308199447626]
    columns = ("wx_radps", "wy_radps", "wz_radps", "ax_mps2", "ay_mps2", "az_mps2")
    assert table.numbers(*columns).tolist() == [[1, 2, 3, 4, 5, 6]]
    path.write_text("time [ms],gyro_x [deg/s],acc_z [g]\n2500,90,1\n")
    table = Columns.of([]).read(path, "imu")
    assert table.times().tolist() == [2_500_000_000]
    assert table.numbers("wx_radps", "az_mps2") == pytest.approx(
        np.array([[np.pi / 2, 9.80665]]), abs=1e-12
    )
