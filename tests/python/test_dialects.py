# SPDX-License-Identifier: MIT
"""One trajectory as other programs write it down; and what evaluate asks where it was misread."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from converted import Run
from numpy.typing import NDArray
from pelorus.converters import csv
from pelorus.converters.columns import Columns
from pelorus.evaluate import misread
from pelorus.io.foreign import ForeignFileError
from pelorus.io.trajectory import read_truth
from pelorus.math import se3
from pelorus.math.se3 import Poses
from scipy.spatial.transform import Rotation

COUNT = 120
T_NS = 1_650_000_000_400_000_000 + np.arange(COUNT, dtype=np.int64) * 40_000_000
Writer = Callable[[Poses, NDArray[np.int64]], str]


def way() -> Poses:
    """Up and down and round, turning about all axes."""
    k = np.arange(COUNT)
    p = np.stack((4 * np.sin(k / 19), 3 * np.cos(k / 23) - 3, 0.02 * k), axis=-1)
    turns = np.stack((0.4 * np.sin(k / 31), 0.3 * np.sin(k / 17), 0.03 * k), axis=-1)
    return Poses(Rotation.from_rotvec(turns).as_matrix(), p)


def quaternions(poses: Poses) -> NDArray[np.float64]:
    """x y z w."""
    return np.asarray(Rotation.from_matrix(poses.R).as_quat())


def rows(first: list[str], *numbers: NDArray[np.float64], apart: str = " ") -> str:
    table = np.hstack(numbers)
    lines = [
        apart.join([t, *(f"{x:.9f}" for x in row)]) for t, row in zip(first, table, strict=True)
    ]
    return "\n".join([*lines, ""])


def seconds(t_ns: NDArray[np.int64]) -> list[str]:
    return [f"{t // 10**9}.{t % 10**9:09d}" for t in t_ns.tolist()]


def whole(t_ns: NDArray[np.int64], behind: str = "") -> list[str]:
    return [f"{t}{behind}" for t in t_ns.tolist()]


def w_first(poses: Poses) -> NDArray[np.float64]:
    return np.roll(quaternions(poses), 1, axis=1)


def tum(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    return rows(seconds(t_ns), poses.p, quaternions(poses))


def orb_slam(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    return rows(whole(t_ns, ".000000"), poses.p, quaternions(poses))


def vins(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    text = rows(whole(t_ns), poses.p, w_first(poses), 0.1 + poses.p, apart=",")
    return text.replace("\n", ",\n")


def vins_loop(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    return rows(whole(t_ns), poses.p, w_first(poses), apart=",")


def open_vins(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    covariance = np.full((COUNT, 12), 1e-6)
    covariance[3] = np.nan
    names = "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12\n"
    return names + rows(seconds(t_ns), poses.p, quaternions(poses), covariance)


def named_w_first(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    return "#t x y z q_w q_x q_y q_z\n" + rows(seconds(t_ns), poses.p, w_first(poses))


def rotation_before_position(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    names = "timestamp [s],qw,qx,qy,qz,px [m],py [m],pz [m]\n"
    return names + rows(seconds(t_ns), w_first(poses), poses.p, apart=",")


def euroc_from_0(poses: Poses, t_ns: NDArray[np.int64]) -> str:
    behind = np.zeros((COUNT, 9))
    return rows(whole(t_ns), poses.p, w_first(poses), behind, apart=",")


WRITERS = [
    tum,
    orb_slam,
    vins,
    vins_loop,
    open_vins,
    named_w_first,
    rotation_before_position,
    euroc_from_0,
]


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("begin_ns", [0, int(T_NS[0])])
def test_a_trajectory_is_the_same_in_whatever_dialect(
    tmp_path: Path, writer: Writer, begin_ns: int
) -> None:
    path, t_ns = tmp_path / "way.txt", T_NS - T_NS[0] + begin_ns
    path.write_text(writer(way(), t_ns), encoding="ascii")
    found = read_truth(path)
    assert np.array_equal(found.t_ns, t_ns)
    assert np.allclose(found.poses.p, way().p, atol=1e-8)
    assert np.allclose(found.poses.R, way().R, atol=1e-8)


def test_how_a_file_was_read_is_told_where_its_columns_do_not_say_it(tmp_path: Path) -> None:
    def remarks(writer: Writer) -> str:
        path = tmp_path / "way.txt"
        path.write_text(writer(way(), T_NS), encoding="ascii")
        return " ".join(read_truth(path).remarks)

    assert "times in ns, parted by blanks: the quaternion is read as x y z w" in remarks(orb_slam)
    assert "12 numbers behind each pose are not used" in remarks(open_vins)
    assert not remarks(tum)
    assert not remarks(euroc_from_0)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("nan nan nan nan nan nan nan", "holds a number that is not finite"),
        ("1.0 2.0 inf 0 0 0 1", "holds a number that is not finite"),
        ("1.0 2.0 3.0 0 0 0 0", "the quaternion's norm is not 1"),
        ("1.0 2.0", "has 3 numbers; 8 a row are expected"),
    ],
)
def test_poses_that_are_none_are_left_out_if_they_are_few(
    tmp_path: Path, pelorus: Run, line: str, said: str
) -> None:
    lines = tum(way(), T_NS).splitlines()

    def path_with(bad: int) -> Path:
        changed = [f"{t.split()[0]} {line}" for t in lines[10 : 10 + bad]]
        path = tmp_path / "truth.txt"
        path.write_text("\n".join([*lines[:10], *changed, *lines[10 + bad :], ""]))
        return path

    good = tmp_path / "good.txt"
    good.write_text(tum(way(), T_NS))
    told = pelorus("evaluate", good, "--truth", path_with(7))
    assert f"truth.txt: 7 of {COUNT} rows are left out, line 11 first: {said}" in told.err
    assert f"truth_frames   {COUNT - 7} " in told.out
    assert "truth.txt: 7 of" in pelorus("evaluate", path_with(7), "--truth", good).err
    refused = pelorus("evaluate", good, "--truth", path_with(40), status=1).err
    assert f"truth.txt: line 11: {said} (40 of {COUNT} rows)" in refused


def test_a_truth_with_names_of_its_own_is_read_by_convert_too(tmp_path: Path) -> None:
    names = "timestamp,tx,ty,tz,q_w,q_x,q_y,q_z\n"
    path = tmp_path / "truth.csv"
    path.write_text(names + rows(seconds(T_NS), way().p, w_first(way()), apart=","))
    found = csv.truth_of(path, Columns())
    assert np.array_equal(found.t_ns, T_NS)
    assert np.allclose(found.poses.R, way().R, atol=1e-8)
    path.write_text(path.read_text().replace("tx", "x_mm"))
    with pytest.raises(ForeignFileError, match="lacks the column"):
        csv.truth_of(path, Columns())


@pytest.mark.parametrize(
    ("t_ns", "said"),
    [
        (T_NS // 1000, "truth.txt are 1e+03 times too small: are they in us or ms?"),
        (T_NS + 7_000_000, "most are within 0.007 s: --tolerance 0.0077 would take them"),
        (T_NS + 10**12, "truth.txt (1650001000.400 to 1650001005.160 s); 3 are expected\n"),
    ],
)
def test_where_no_times_are_equal_what_would_help_is_told(
    tmp_path: Path, pelorus: Run, t_ns: NDArray[np.int64], said: str
) -> None:
    (tmp_path / "est.txt").write_text(tum(way(), T_NS))
    truth = tmp_path / "truth.txt"
    write = vins_loop if t_ns[0] < 10**18 else tum
    truth.write_text(write(way(), t_ns))
    assert said in pelorus("evaluate", tmp_path / "est.txt", "--truth", truth, status=1).err


# --- what evaluate asks ---------------------------------------------------------------------------


def noisy(poses: Poses) -> Poses:
    chance = np.random.default_rng(8)
    off = se3.exp(chance.normal(0, 0.02, (COUNT, 3)), chance.normal(0, 0.01, (COUNT, 3)))
    return se3.compose(poses, off)


def as_read(poses: Poses, by: int) -> Poses:
    rolled = np.roll(quaternions(poses), by, axis=1)
    return Poses(Rotation.from_quat(rolled).as_matrix(), poses.p)


CAMERA = Rotation.from_euler("zyx", [-90, 7, -90], degrees=True).as_matrix()
MISREAD = [
    (lambda T: as_read(T, 1), "is the quaternion of theirs w first?"),
    (lambda T: as_read(T, -1), "is the quaternion of theirs w last?"),
    (lambda T: Poses(np.swapaxes(T.R, 1, 2), T.p), "are the rotations of theirs world to body?"),
    (se3.inverse, "are the poses of theirs world to body?"),
    (lambda T: Poses(T.R @ CAMERA, T.p), "are the poses of theirs those of another frame"),
    (lambda T: Poses(T.R, 1000 * T.p), "a scale of 1000 fits: theirs is by so much larger than mi"),
    (lambda T: Poses(T.R, 100 * T.p), "is it in cm?"),
    (lambda T: Poses(T.R, T.p / 1000), "mine is by so much larger than theirs: is it in mm?"),
    (lambda T: Poses(T.R, 7 * T.p), "is one of them of a camera that knows no scale?"),
]


@pytest.mark.parametrize("drift_m", [0.0, 1.2])
@pytest.mark.parametrize(("wrong", "asked"), MISREAD)
def test_a_truth_that_would_fit_otherwise_is_asked_about(
    wrong: Callable[[Poses], Poses], asked: str, drift_m: float
) -> None:
    mine, theirs = noisy(way()), wrong(way())
    mine.p[:, 0] += np.linspace(0, drift_m, COUNT)
    found = misread.doubts(
        misread.NamedPoses("mine", mine), misread.NamedPoses("theirs", theirs), True
    )
    assert len(found) == 1
    assert asked in found[0]


def test_an_estimate_in_the_wrong_order_is_named_itself(tmp_path: Path, pelorus: Run) -> None:
    (tmp_path / "est.txt").write_text(rows(seconds(T_NS), way().p, w_first(way())))
    (tmp_path / "truth.txt").write_text(tum(noisy(way()), T_NS))
    said = pelorus("evaluate", tmp_path / "est.txt", "--truth", tmp_path / "truth.txt")
    assert "positions fit to 0.04 m, rotations do not" in said.out
    assert f"is the quaternion of {tmp_path / 'est.txt'} w first? Read so" in said.out
    plain = pelorus("evaluate", tmp_path / "est.txt", "--truth", tmp_path / "truth.txt", "--json")
    assert "w first?" in plain.err
    assert "w first?" not in plain.out


@pytest.mark.parametrize(
    "other",
    [
        lambda T: T,
        lambda T: Poses(T.R, 1.03 * T.p),
        lambda T: Poses(T.R[::-1].copy(), np.random.default_rng(3).normal(0, 900, T.p.shape)),
        lambda T: Poses(T.R, np.zeros_like(T.p)),
        lambda T: T.at(slice(0, 2)),
        lambda T: Poses(T.R @ Rotation.from_rotvec([0.05, 0.03, -0.04]).as_matrix(), T.p),
    ],
)
def test_where_nothing_else_would_fit_nothing_is_asked(other: Callable[[Poses], Poses]) -> None:
    """Right; a little longer; of another drive; standing; too short; turned by 4 degrees."""
    theirs = other(way())
    mine = noisy(way()).at(slice(0, len(theirs.p)))
    assert not misread.doubts(misread.NamedPoses("a", mine), misread.NamedPoses("b", theirs), False)
