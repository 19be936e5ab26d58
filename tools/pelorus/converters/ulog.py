# SPDX-License-Identifier: MIT
"""Reads the IMU in a log of PX4 (.ulg) with pyulog, as a table of the project's columns.

sensor_combined are the readings that PX4's estimator uses; where a log lacks them, vehicle_imu has
angles and velocities summed over an interval, whose mean rates are taken. Axes are forward, right
and down; times are PX4's own, in us.
"""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.io import foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.io.table import Table
from pelorus.program.extras import extra

MAGIC = b"ULog\x01\x12\x35"
COMBINED, SUMMED = "sensor_combined", "vehicle_imu"
AXES = ("x", "y", "z")


def is_one(path: Path) -> bool:
    """Returns whether the file's first bytes are a ULog's."""
    return path.is_file() and foreign.beginning(path).startswith(MAGIC)


def table(path: Path, file: str) -> Table:
    """Returns a table with t_us, ax_mps2, wx_radps and so on; `file` is the option's name."""
    if file not in ("imu", "gyro"):
        raise ForeignFileError(path, "is a log of PX4; it is read as --imu or --gyro alone")
    with extra("pyulog"):
        from pyulog import ULog  # noqa: PLC0415 - an extra
    try:
        with redirect_stdout(StringIO()):  # it prints its opinion of damaged files
            log = ULog(str(path), [COMBINED, SUMMED])
    except Exception as error:  # it raises a dozen kinds on damaged files
        words = (str(error).splitlines() or [type(error).__name__])[0]
        raise ForeignFileError(path, f"cannot be read as a ULog: {words}") from error
    streams = {(one.name, one.multi_id): one.data for one in log.data_list if len(one.data)}
    if not streams:
        raise ForeignFileError(path, f"has no messages of {COMBINED} or {SUMMED}")
    name, instance = min(streams)
    columns = _numbers(path, name, streams[name, instance])
    found = Table(path, {key: [repr(x) for x in column] for key, column in columns.items()})
    others = ", ".join(f"{n} {k}" for n, k in sorted(streams) if (n, k) != (name, instance))
    found.remarks.append(
        f"{path}: {name} {instance} is taken" + (f", not {others}" if others else "") + ": axes "
        "forward, right, down, of which the calibration must be, too; times of PX4's clock"
    )
    return found


def _numbers(path: Path, name: str, data: dict[str, Any]) -> dict[str, list[float | int]]:
    """Returns the columns of one stream."""
    turned, forced = ("gyro_rad", "accelerometer_m_s2")
    if name == SUMMED:
        turned, forced = "delta_angle", "delta_velocity"
    needed = [f"{field}[{k}]" for field in (turned, forced) for k in range(3)]
    lacking = [field for field in ("timestamp", *needed) if field not in data]
    if lacking:
        raise ForeignFileError(path, f"{name} lacks {', '.join(lacking)}")
    seconds = {field: np.ones(len(data["timestamp"])) for field in (turned, forced)}
    if name == SUMMED:
        seconds = {field: np.asarray(data[f"{field}_dt"], np.float64) * 1e-6 for field in seconds}
    out: dict[str, list[float | int]] = {"t_us": np.asarray(data["timestamp"]).tolist()}
    for field, short, unit in ((turned, "w", "radps"), (forced, "a", "mps2")):
        for k, axis in enumerate(AXES):
            mean = np.asarray(data[f"{field}[{k}]"], np.float64) / seconds[field]
            out[f"{short}{axis}_{unit}"] = mean.tolist()
    return out
