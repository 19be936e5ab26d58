# SPDX-License-Identifier: MIT
"""`pelorus export RECORDING|RESULT [--frames OUT.csv] [--map OUT.ply] [--tum OUT.tum]`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy
import typer

from pelorus.commands.choices import CONFIG, PROGRAMS, SETTINGS, replay_options
from pelorus.converters.landmark_map import COVARIANCE, POSITION, WORLD
from pelorus.errors import PelorusError, write_text
from pelorus.evaluate.evaluation import made_in, sigmas_m
from pelorus.evaluate.frame_table import frame_table, write_csv
from pelorus.io.trajectory import estimate_in
from pelorus.native.replay import result_of
from pelorus.wire.frames import Landmark, Message

app = typer.Typer()


@app.command(
    epilog="Example:  pelorus export log.plr --frames frames.csv --map map.ply --tum way.tum"
)
def export(
    source: Path = typer.Argument(
        ..., metavar="RECORDING|RESULT", help="A recording, or what a filter left of it."
    ),
    frames_file: Path | None = typer.Option(
        None,
        "--frames",
        metavar="OUT.csv",
        help="A row a frame: pose, variances, counts, NIS, time.",
    ),
    map_file: Path | None = typer.Option(
        None,
        "--map",
        metavar="OUT.csv|OUT.ply",
        help="The landmarks that left the state, and those at the end: with covariance, for "
        "pelorus convert map; or to look at.",
    ),
    tum_file: Path | None = typer.Option(
        None, "--tum", metavar="OUT.tum", help="The trajectory: t x y z qx qy qz qw, as evo reads."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    programs: Path | None = PROGRAMS,
) -> None:
    """Write what a filter found as tables for other programs. A recording is replayed first."""
    if frames_file is None and map_file is None and tum_file is None:
        raise typer.BadParameter("say what to write", param_hint="--frames / --map / --tum")
    messages = result_of(source, replay_options(config, settings), programs)
    if frames_file is not None:
        write_csv(frames_file, frame_table(messages))
    if tum_file is not None:
        write_tum(tum_file, messages)
    if map_file is not None:
        write_map(map_file, made_in(messages))


# --- tables ---------------------------------------------------------------------------------------


PLY_HEAD = """ply
format ascii 1.0
comment landmarks in the world, m; role 1: left the state, 2: held at the end
comment sigma: root of the mean variance of an axis, m
element vertex {count}
property double x
property double y
property double z
property uint id
property uchar role
property uint times_seen
property float sigma
end_header
"""


def write_map(path: Path, landmarks: Sequence[Landmark]) -> None:
    """Writes the landmarks in the format of the file's name."""
    if path.suffix not in (".csv", ".ply"):
        raise PelorusError(f"{path}: is neither .csv nor .ply")
    text = _csv(landmarks) if path.suffix == ".csv" else _ply(landmarks)
    write_text(path, text)


def write_tum(path: Path, messages: Sequence[Message]) -> None:
    """Writes the body's poses after each frame, to the nanosecond, for `evaluate` and evo."""
    found = estimate_in(messages)
    if found is None:
        raise PelorusError("there is no pose after a frame to write")
    t_ns, poses = found[0].t_ns, found[0].poses
    turns = scipy.spatial.transform.Rotation.from_matrix(poses.R).as_quat(canonical=True)
    rows = [
        f"{t // 10**9}.{t % 10**9:09d} {_numbers(p, ' ')} {_numbers(q, ' ')}\n"
        for t, p, q in zip(t_ns.tolist(), poses.p, turns, strict=True)
    ]
    write_text(path, "# t x y z qx qy qz qw\n" + "".join(rows))


def _csv(landmarks: Sequence[Landmark]) -> str:
    titles = ("id", *POSITION, *COVARIANCE, "frame")
    rows = [
        ",".join((str(m.id), _numbers((*m.p_W_m, *m.covariance), ","), WORLD)) for m in landmarks
    ]
    return "\n".join((",".join(titles), *rows)) + "\n"


def _ply(landmarks: Sequence[Landmark]) -> str:
    sigmas = sigmas_m(landmarks)
    rows = [
        f"{_numbers(m.p_W_m, ' ')} {m.id} {int(m.role)} {m.times_seen} {sigma:.6g}\n"
        for m, sigma in zip(landmarks, sigmas.tolist(), strict=True)
    ]
    return PLY_HEAD.format(count=len(landmarks)) + "".join(rows)


def _numbers(
    values: Sequence[float] | np.ndarray[tuple[int], np.dtype[np.float64]], by: str
) -> str:
    return by.join(f"{value:.9g}" for value in values)
