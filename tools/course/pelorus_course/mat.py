# SPDX-License-Identifier: MIT
"""Opens .mat files, with errors that say what is expected."""

from __future__ import annotations

from pathlib import Path

from pelorus.io import foreign
from pelorus.io.arrays import Arrays
from pelorus.io.foreign import ArraysByName, ForeignFileError

from pelorus_course import matfile


def mat(path: Path) -> ArraysByName:
    """Reads all variables of a MATLAB file of version 5 to 7."""
    foreign.require_file(path)
    packed = foreign.content(path, foreign.ARRAYS_BYTES_MAX)
    if matfile.is_hdf5(packed):
        raise ForeignFileError(path, "is a MATLAB 7.3 file (HDF5); save it with -v7 to convert it")
    try:
        return matfile.arrays(packed, foreign.ARRAYS_BYTES_MAX)
    except matfile.BrokenMatFile as error:
        raise ForeignFileError(path, f"cannot be read as .mat: {error}") from None


def read_mat(path: Path) -> Arrays:
    """Reads all variables of a MATLAB file up to version 7."""
    return Arrays(path, mat(path))
