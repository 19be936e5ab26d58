# SPDX-License-Identifier: MIT
"""Arrays out of .npz and .mat files, with errors that say what is there and what is due."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from pelorus.errors import PelorusError
from pelorus.frames import Camera
from pelorus.se3 import Floats

ORTHOGONAL_TOLERANCE = 1e-3
SECONDS_MAX = 9e9  # below 2^63 ns


class Arrays:
    """The named arrays of one file."""

    def __init__(self, path: Path, arrays: dict[str, NDArray[np.generic]]) -> None:
        self.path = path
        self._arrays = arrays

    def has(self, key: str) -> bool:
        return key in self._arrays

    def one_of(self, *keys: str) -> str:
        """The first of the keys that the file has."""
        for key in keys:
            if key in self._arrays:
                return key
        there = ", ".join(sorted(self._arrays)) or "none"
        raise PelorusError(f"{self.path}: lacks the array {' or '.join(keys)}; there are: {there}")

    def get(self, *keys: str, shape: tuple[int | None, ...] | None = None) -> Floats:
        """The array of the first of the keys; `None` in the shape stands for any size."""
        key = self.one_of(*keys)
        try:
            array = np.asarray(self._arrays[key], dtype=np.float64)
        except (TypeError, ValueError):
            raise PelorusError(f"{self.path}: {key} holds no numbers") from None
        if shape is not None and not _fits(array.shape, shape):
            due = " x ".join("n" if size is None else str(size) for size in shape)
            raise PelorusError(f"{self.path}: {key} has the shape {array.shape}, due is {due}")
        if not np.isfinite(array).all():
            where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
            raise PelorusError(f"{self.path}: {key}{list(where)} is not finite")
        return array

    def scalar(self, key: str) -> float:
        array = self.get(key)
        if array.size != 1:
            raise PelorusError(f"{self.path}: {key} has the shape {array.shape}, due is one number")
        return float(array.reshape(()))


def _fits(shape: tuple[int, ...], due: tuple[int | None, ...]) -> bool:
    return len(shape) == len(due) and all(
        d is None or s == d for s, d in zip(shape, due, strict=True)
    )


def read_npz(path: Path) -> Arrays:
    """All arrays of a .npz file; pickled objects are refused."""
    _check_there(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            return Arrays(path, {key: file[key] for key in file.files})
    except (ValueError, EOFError, AttributeError) as error:
        if not zipfile.is_zipfile(path):
            raise PelorusError(f"{path}: is no .npz file (a zip of numpy arrays)") from error
        raise PelorusError(f"{path}: cannot be read as .npz: {error}") from error
    except (OSError, zipfile.BadZipFile) as error:
        raise PelorusError(f"{path}: cannot be read as .npz: {error}") from error


def read_mat(path: Path) -> Arrays:
    """All variables of a MATLAB file up to version 7."""
    _check_there(path)
    try:
        file = loadmat(path)
    except NotImplementedError:
        raise PelorusError(
            f"{path}: is a MATLAB 7.3 file (HDF5); save it with -v7 to convert it"
        ) from None
    except (OSError, ValueError, TypeError, EOFError, MatReadError) as error:
        raise PelorusError(f"{path}: cannot be read as .mat: {error}") from error
    return Arrays(path, {key: value for key, value in file.items() if not key.startswith("__")})


def _check_there(path: Path) -> None:
    if not path.is_file():
        raise PelorusError(f"{path}: there is no such file")
    if path.stat().st_size == 0:
        raise PelorusError(f"{path}: the file is empty")


def camera_of(path: Path, fx: float, fy: float, cx: float, cy: float, baseline: float) -> Camera:
    """The camera, if its numbers can be one's."""
    if min(fx, fy, baseline) <= 0:
        raise PelorusError(
            f"{path}: focal lengths {fx}, {fy} px and baseline {baseline} m must be positive"
        )
    return Camera(fx, fy, cx, cy, baseline)


def nanoseconds(path: Path, what: str, seconds: Floats) -> NDArray[np.int64]:
    """Seconds -> ns, checked to ascend."""
    if len(seconds) == 0:
        raise PelorusError(f"{path}: {what} is empty")
    check_seconds(path, what, seconds)
    t_ns = np.round(seconds * 1e9).astype(np.int64)
    back = np.nonzero(np.diff(t_ns) <= 0)[0]
    if len(back):
        k = int(back[0])
        raise PelorusError(
            f"{path}: {what} does not ascend at {k + 1} ({seconds[k]:.9f} s, then "
            f"{seconds[k + 1]:.9f} s)"
        )
    return t_ns


def check_seconds(path: Path, what: str, seconds: Floats) -> None:
    """Refuse times that are no seconds: negative ones, or nanoseconds by mistake."""
    if seconds.min() < 0 or seconds.max() > SECONDS_MAX:
        raise PelorusError(
            f"{path}: {what} spans {seconds.min():g} to {seconds.max():g}; "
            f"seconds from 0 to {SECONDS_MAX:g} are due"
        )


def rotation(path: Path, name: str, R: Floats) -> Floats:
    """R itself if it is a rotation."""
    error = float(np.abs(R @ R.T - np.eye(3)).max())
    if error > ORTHOGONAL_TOLERANCE or np.linalg.det(R) < 0:
        raise PelorusError(
            f"{path}: {name} is no rotation "
            f"(R R^T - I reaches {error:.2g}, determinant {np.linalg.det(R):.3f})"
        )
    return R
