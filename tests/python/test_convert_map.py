# SPDX-License-Identifier: MIT
"""`pelorus convert map`: a map comes back in, and a drive is localised in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run
from pelorus.wire import framing
from pelorus.wire.frames import BodyAxes, Header, Landmark, Role, Truth, Twist
from pelorus.wire.layout import unpack_symmetric
from replay_drive import BIN, drive, encode, header, log_of, points, truth
from replay_drive import run as run_replay

COVARIANCE = "cov_xx_m2,cov_yx_m2,cov_yy_m2,cov_zx_m2,cov_zy_m2,cov_zz_m2"
GOOD = "0.04,0.01,0.09,-0.02,0.003,0.16"


@pytest.fixture
def like(tmp_path: Path) -> Path:
    path = tmp_path / "like.plr"
    path.write_bytes(encode([header(body_axes=BodyAxes.FORWARD_LEFT_UP, name="like")]))
    return path


def csv(folder: Path, columns: str, *rows: str) -> Path:
    path = folder / "map.csv"
    path.write_text("\n".join([columns, *rows]) + "\n")
    return path


def landmarks_in(path: Path) -> list[Landmark]:
    return [m for m in log_of(path) if isinstance(m, Landmark)]


def convert(pelorus: Run, source: Path, like: Path, status: int = 0) -> tuple[Any, Path]:
    target = source.with_name("out.plr")
    return pelorus("convert", "map", source, target, "--like", like, status=status), target


# --- what arrives ---------------------------------------------------------------------------------


def test_position_and_covariance_arrive_under_their_ids(
    pelorus: Run, tmp_path: Path, like: Path
) -> None:
    columns = f"{COVARIANCE},z_m,y_m,x_m,id"
    _said, target = convert(pelorus, csv(tmp_path, columns, f"{GOOD},3,2,1,4294967295"), like)
    (found,) = landmarks_in(target)
    assert (found.id, found.role, found.p_W_m.tolist()) == (2**32 - 1, Role.KNOWN, [1, 2, 3])
    P = unpack_symmetric(found.covariance[None], 3)[0]
    assert P.tolist() == [[0.04, 0.01, -0.02], [0.01, 0.09, 0.003], [-0.02, 0.003, 0.16]]
    received, counts = framing.read_file(target)
    theirs, ours = (framing.header_of(framing.read_file(path)[0], path) for path in (like, target))
    assert theirs == ours
    assert counts.ended
    assert len(received) == 3


def test_one_sigma_stands_for_all_axes(pelorus: Run, tmp_path: Path, like: Path) -> None:
    source = csv(tmp_path, "id,x_m,y_m,z_m,sigma_m,frame", "7,1,2,3,0.5,world", "8,1,2,4,0.1,world")
    said, target = convert(pelorus, source, like)
    assert landmarks_in(target)[0].covariance.tolist() == [0.25, 0, 0.25, 0, 0, 0.25]
    assert "2 known landmarks, sigma 0.1 to 0.5 m" in said.out


def test_the_map_of_one_drive_localises_the_next(pelorus: Run, tmp_path: Path) -> None:
    """First the drive makes a map, then its CSV is the map of the same road, driven with twists
    that are half of what is true: what finds the pose can only be the map.
    """
    path, table = tmp_path / "first.plr", tmp_path / "map.csv"
    path.write_bytes(encode(drive(sigma_px=0.1)))
    options = ("--bin", BIN, "--set", "pixel-sigma=0.1")
    pelorus("export", path, "--map", table, *options)
    _said, target = convert(pelorus, table, path)
    known = landmarks_in(target)
    assert len(known) > 40
    error = [np.linalg.norm(m.p_W_m - points()[m.id]) for m in known]
    assert np.median(error) < 0.05
    first, *rest = drive(sigma_px=0.1)
    halved = [replace(m, v_B_mps=0.5 * m.v_B_mps) if isinstance(m, Twist) else m for m in rest]
    start_only = [m for m in halved if not isinstance(m, Truth) or m == truth(0)]
    path.write_bytes(encode([first, *known, *start_only]))
    out = tmp_path / "second.tum"
    result = run_replay(path, "--mode", "localization", "--trajectory", out, "--pixel-sigma", "1",
                        "--velocity-sigma", "1", "--json")  # fmt: skip
    assert result.status == 0, result.stderr
    assert result.summary["used"] > 500
    last = np.loadtxt(out)[-1, 1:4]
    assert np.linalg.norm(last - truth(len(np.loadtxt(out)) - 1).p_WB_m) < 0.05


# --- what is refused ------------------------------------------------------------------------------

SIGMA = "id,x_m,y_m,z_m,sigma_m"
FULL = f"id,x_m,y_m,z_m,{COVARIANCE}"


@pytest.mark.parametrize(
    ("columns", "rows", "words"),
    [
        (SIGMA, ("7,1,2,3,1", "8,1,1,1,1", "7,1,2,4,1"), ("id 7 stands 2 times", "rows 2 and 4")),
        (SIGMA, ("7,1,2,3,-1",), ("row 2", "sigma_m is negative")),
        (SIGMA, ("7,1,2,3,1", "8,1,2,3,0"), ("row 3", "the covariance is zero")),
        (SIGMA, ("7,1,2,3,nan",), ("row 2", "sigma_m is not finite")),
        (SIGMA, ("7,1,2,3,1e9",), ("row 2", "nothing is known")),
        (SIGMA, ("-7,1,2,3,1",), ("row 2", "whole number from 0")),
        (SIGMA, ("7,1,2,inf,1",), ("row 2", "z_m is not finite")),
        (SIGMA, (), ("holds column names but no row",)),
        ("id,x_m,y_m,z_m", ("7,1,2,3",), ("nothing of how certain", "sigma_m", "cov_zz_m2")),
        ("id,x_m,y_m,z_m,cov_xx_m2", ("7,1,2,3,1",), ("lacks the column cov_yx_m2",)),
        (FULL, (f"7,1,2,3,{GOOD.replace('0.09', '-0.09')}",), ("row 2", "a variance is negative")),
        (FULL, ("7,1,2,3,1,2,1,0,0,1",), ("row 2", "a correlation is beyond 1")),
        (f"{SIGMA},frame", ("7,1,2,3,1,camera",), ("row 2", "the frame 'camera'", "world")),
        ("id,x,y,z,sigma_m", ("7,1,2,3,1",), ("lacks the column x_m, y_m, z_m",)),
    ],
)
def test_a_map_that_cannot_be_one_is_refused(
    pelorus: Run,
    tmp_path: Path,
    like: Path,
    columns: str,
    rows: Sequence[str],
    words: Sequence[str],
) -> None:
    said, target = convert(pelorus, csv(tmp_path, columns, *rows), like, status=1)
    for word in words:
        assert word in said.err
    assert not target.exists()


def test_without_a_header_there_is_no_map(pelorus: Run, tmp_path: Path) -> None:
    like = tmp_path / "like.plr"
    like.write_bytes(encode([m for m in drive(3) if not isinstance(m, Header)]))
    said, target = convert(pelorus, csv(tmp_path, SIGMA, "7,1,2,3,1"), like, status=1)
    assert "holds no HEADER" in said.err
    assert not target.exists()
