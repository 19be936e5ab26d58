# SPDX-License-Identifier: MIT
"""CSV as data sets and pandas write it: comments, names behind a #, whole numbers with a point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pelorus.converters.columns import Columns
from pelorus.foreign import ForeignFileError
from pelorus.table import Table

EUROC = "#timestamp [ns],w_RS_S_x [rad s^-1],a_RS_S_x [m s^-2]\n"


def table_of(folder: Path, words: str) -> Table:
    path = folder / "x.csv"
    path.write_text(words, encoding="utf-8")
    return Table.read(path)


@pytest.mark.parametrize(
    "head",
    ["# made by me\nt_ns,vx_mps\n", "t_ns,vx_mps\n# ns, m/s\n", "# a\n\n# b, c\n#t_ns,vx_mps\n"],
)
def test_comments_before_the_first_row_of_numbers_are_passed_over(
    tmp_path: Path, head: str
) -> None:
    table = table_of(tmp_path, head + "1,2.5\n2,3.5\n")
    assert table.names == ["t_ns", "vx_mps"]
    assert table.ascending_times().tolist() == [1, 2]
    assert table.numbers("vx_mps")[:, 0].tolist() == [2.5, 3.5]


def test_rows_are_counted_with_the_comments(tmp_path: Path) -> None:
    table = table_of(tmp_path, "# made by me\nt_ns,vx_mps\n# more\n1,2\n2,fast\n")
    with pytest.raises(ForeignFileError, match="row 5: vx_mps is 'fast'"):
        table.numbers("vx_mps")
    with pytest.raises(ForeignFileError, match="row 4: has 3 cells"):
        table_of(tmp_path, "# made by me\n\n#t_ns,vx_mps\n1,2\n1,2,3\n")


def test_names_of_EuRoC_have_their_units_in_brackets(tmp_path: Path) -> None:
    path = tmp_path / "imu.csv"
    path.write_text(EUROC + "1403636579763555584,0.5,9.5\n", encoding="utf-8")
    names = "t=timestamp [ns],wx=w_RS_S_x [rad s^-1],ax=a_RS_S_x [m s^-2]"
    table = Columns.of([names]).read(path, "imu")
    assert table.times().tolist() == [1403636579763555584]
    assert np.array_equal(table.numbers("wx_radps", "ax_mps2"), [[0.5, 9.5]])


@pytest.mark.parametrize(
    ("name", "cell", "due"),
    [("t_ms", "1_763", "a number is due"), ("t_ns", "1_763", "a whole number")],
)
def test_a_time_with_an_underscore_is_a_slip(
    tmp_path: Path, name: str, cell: str, due: str
) -> None:
    with pytest.raises(ForeignFileError, match=f"row 2: {name} is '{cell}', {due}"):
        table_of(tmp_path, f"{name},x\n{cell},1\n").times()


def test_whole_numbers_may_have_a_point(tmp_path: Path) -> None:
    table = table_of(tmp_path, "id,x\n3.0,1\n4.,1\n5,1\n")
    assert table.integers("id", 9).tolist() == [3, 4, 5]
    for cell in ("3.5", "-3.0", ".0", "1e0", "3.0.0"):
        with pytest.raises(ForeignFileError, match="a whole number from 0 to 9 is due"):
            table_of(tmp_path, f"id,x\n{cell},1\n").integers("id", 9)
