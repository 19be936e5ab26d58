# SPDX-License-Identifier: MIT
"""The filter's results for each stereo frame, by column, and as CSV."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from pelorus.errors import PelorusError, write_text
from pelorus.math.motion import Times
from pelorus.wire.frames import Kind, Message, Pose, Report, Stereo
from pelorus.wire.layout import Floats
from pelorus.wire.schema import HEALTHS
from pelorus.wire.settings import in_force

HEALTH = tuple(HEALTHS.values())
RHO_THETA = tuple(f"var_{part}_{axis}" for part in ("rho", "theta") for axis in "xyz")
BIASES = tuple(f"bias_{part}{axis}" for part in "vw" for axis in "xyz")
ESTIMATE = (
    *("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", *RHO_THETA, "trace"),
    *("vx_mps", "vy_mps", "vz_mps", "wx_radps", "wy_radps", "wz_radps"),
    *(*BIASES, *(f"var_{name}" for name in BIASES)),
)
REPORT = (
    *("status", "health", "reasons", "budget", "observations", "matched", "used", "gated"),
    *("created", "evicted", "refused", "duplicates", "no_room", "poor", "left_out"),
    *("blocks_failed", "active", "nis", "nis_dof", "update_us"),
    *("innovation_rows", "innovation_d2", "innovation_log_det"),
)
DIAGONAL = [i * (i + 3) // 2 for i in range(6)]  # of a packed 6 x 6


@dataclass(frozen=True)
class FrameTable:
    """A row for each frame, refused ones too: NaN where there is no estimate, or no covariance."""

    t_ns: Times
    columns: dict[str, Floats]
    by_imu: bool = False  # bias_v* are then the accelerometer's, named bias_a* in a file

    def __getitem__(self, name: str) -> Floats:
        return self.columns[name]

    def stack(self, *names: str) -> Floats:
        """Returns the named columns (rows, len(names))."""
        return np.stack([self.columns[name] for name in names], axis=-1)

    @property
    def reasons(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Returns the bits of `plr_reason`."""
        return self.columns["reasons"].astype(np.int64)


def frame_table(messages: Sequence[Message]) -> FrameTable:
    """Makes the table from the messages of a result."""
    rows = list(_answers(messages))
    if not rows:
        raise PelorusError("the result holds no answer to a stereo frame")
    estimate = np.full((len(rows), len(ESTIMATE)), np.nan)
    report = np.empty((len(rows), len(REPORT)))
    t_ns = np.empty(len(rows), np.int64)
    for k, (pose, answer) in enumerate(rows):
        if pose is not None:
            estimate[k] = _estimate(pose)
        report[k] = [getattr(answer, name) for name in REPORT]
        t_ns[k] = answer.t_ns
    columns = dict(zip((*ESTIMATE, *REPORT), (*estimate.T, *report.T), strict=True))
    return FrameTable(t_ns, columns, bool(in_force(messages, "process")))


def _answers(messages: Sequence[Message]) -> Iterator[tuple[Pose | None, Report]]:
    """Yields each frame's pose, None if it was refused, and its report."""
    pose: Pose | None = None
    for message in messages:
        if isinstance(message, Stereo):
            pose = None
        elif isinstance(message, Pose) and message.after_stereo:
            pose = message
        elif isinstance(message, Report) and message.subject == Kind.STEREO:
            yield pose, message
            pose = None


def _estimate(pose: Pose) -> Floats:
    variances = np.append(pose.covariance[DIAGONAL], pose.trace)
    of_bias = np.asarray(pose.bias_variance, np.float64)
    return np.concatenate(
        (
            pose.p_WB_m,
            scipy.spatial.transform.Rotation.from_matrix(pose.R_WB).as_quat(canonical=True),
            np.where(pose.knows_covariance & (variances >= 0), variances, np.nan),
            pose.v_B_mps,
            pose.w_B_radps,
            pose.bias,
            np.where(pose.knows_covariance & (of_bias >= 0), of_bias, np.nan),
        )
    )


def write_csv(path: Path, table: FrameTable) -> None:
    """Writes CSV with times to the nanosecond; unknown values are empty."""
    names = {"created": "new"}  # columns with another usual name
    if table.by_imu:
        names |= {name: name.replace("bias_v", "bias_a") for name in table.columns}
        names["created"] = "new"
    titles = ",".join(("t_s", *(names.get(name, name) for name in table.columns)))
    rows = np.stack(list(table.columns.values()), axis=-1)
    health = list(table.columns).index("health")
    lines = [titles]
    for t, row in zip(table.t_ns.tolist(), rows.tolist(), strict=True):
        cells = ["" if np.isnan(x) else f"{x:.9g}" for x in row]
        cells[health] = HEALTH[int(row[health])]
        lines.append(",".join((f"{t // 10**9}.{t % 10**9:09d}", *cells)))
    write_text(path, "\n".join(lines) + "\n")
