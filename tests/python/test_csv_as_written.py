# SPDX-License-Identifier: MIT
"""CSV as data sets and pandas write it: comments, names behind a #, whole numbers with a point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pelorus.converters.columns import Columns
from pelorus.io.foreign import ForeignFileError
from pelorus.io.table import Table

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
    [("t_ms", "1_763", "a number is expected"), ("t_ns", "1_763", "a whole number")],
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
        with pytest.raises(ForeignFileError, match="a whole number from 0 to 9 is expected"):
            table_of(tmp_path, f"id,x\n{cell},1\n").integers("id", 9)


def read(folder: Path, words: str, *mapping: str) -> tuple[Table, list[str]]:
    """As the converters do; and what is to be said of it."""
    path = folder / "twists.csv"
    path.write_text(words, encoding="utf-8")
    columns = Columns.of(list(mapping))
    return columns.read(path, "twists"), columns.remarks


def test_columns_of_plain_names_are_taken_in_si_units_and_that_is_said(tmp_path: Path) -> None:
    whole = "t,vx,wz,az,px,uL,qx\n0.5,1.5,0.2,9.7,3,200,0.1\n0.7,1.6,0.3,9.9,4,201,0.2\n"
    for mapping in ([], ["vx=vx,t=t"]):
        table, remarks = read(tmp_path, whole, *mapping)
        assert table.ascending_times().tolist() == [500_000_000, 700_000_000]
        numbers = table.numbers("vx_mps", "wz_radps", "az_mps2", "px_m", "uL_px", "qx")
        assert numbers[1].tolist() == [1.6, 0.3, 9.9, 4, 201, 0.2]
        said = " ".join(remarks)
        assert "taken t in s; vx in mps; wz in radps; az in mps2; px in m. In another unit:" in said
        assert len(remarks) == 1
        assert "uL" not in said
    table, remarks = read(tmp_path, whole, "vx=vx:kmh,t=t:ms")
    assert table.numbers("vx_mps")[0, 0] == pytest.approx(1.5 / 3.6)
    assert table.ascending_times().tolist() == [500_000, 700_000]
    assert not remarks


def test_a_plain_time_is_in_ns_where_its_steps_say_so(tmp_path: Path) -> None:
    table, remarks = read(tmp_path, "t,vx\n0,1\n20000000,1\n40000000,1\n")
    assert table.ascending_times().tolist() == [0, 20_000_000, 40_000_000]
    assert "taken t in ns. In another unit: --columns t=t:UNIT" in remarks[0]
    table, _ = read(tmp_path, "t,vx\n1763822000.25,1\n1763822000.5,1\n")
    assert table.ascending_times().tolist() == [
        1_763_822_000_250_000_000,
        1_763_822_000_500_000_000,
    ]


def test_rows_without_numbers_are_left_out_if_they_are_few_and_others_keep_their_place(
    tmp_path: Path,
) -> None:
    rows = [f"{k / 10:.1f},{k},1" for k in range(1, 41)]
    rows[7], rows[11], rows[20], rows[30] = "0.8,,1", "nan,12,1", "0.0,5,1", rows[29]
    table, remarks = read(tmp_path, "t_s,vx_mps,unused\n" + "\n".join(rows) + "\n4.1,x,1\n")
    table.leave_out_bad("vx_mps")
    assert table.count == 41 - 3
    for words in (
        "1 of 41 rows are left out, row 13 first: t_s is not finite",
        "1 of 40 rows are left out, row 9 first: vx_mps is not finite",
        "1 of 39 rows are left out, row 32 first: time does not ascend but repeats",
    ):
        assert f"twists.csv: {words}" in " ".join(remarks)
    with pytest.raises(ForeignFileError, match="row 42: vx_mps is 'x', a number is expected"):
        table.numbers("vx_mps")
    with pytest.raises(ForeignFileError, match=r"row 22: .*does not ascend"):
        table.ascending_times()


def test_a_file_most_of_whose_rows_have_no_number_is_refused(tmp_path: Path) -> None:
    table, _ = read(tmp_path, "t_s,vx_mps\n1,2\n2,nan\n3,2\n4,nan\n5,2\n")
    with pytest.raises(ForeignFileError, match=r"row 3: vx_mps is not finite \(2 of 5 rows\)"):
        table.leave_out_bad("vx_mps")


def test_a_time_that_was_never_set_is_left_out_but_not_the_zero_of_a_clock(tmp_path: Path) -> None:
    today = [f"{1_763_822_000 + k / 10:.1f},{k}" for k in range(30)]
    table, remarks = read(tmp_path, "t_s,vx_mps\n0,1\n" + "\n".join(today) + "\n")
    table.leave_out_bad("vx_mps")
    assert table.ascending_times()[0] == 1_763_822_000 * 10**9
    assert "row 2 first: its time is 0: it was never set" in remarks[0]
    table, remarks = read(tmp_path, "t_s,vx_mps\n0,1\n0.1,1\n0.2,1\n")
    table.leave_out_bad("vx_mps")
    assert table.count == 3
    assert not remarks
