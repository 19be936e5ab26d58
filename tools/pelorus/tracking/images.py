# SPDX-License-Identifier: MIT
"""Two folders of rectified pictures: which belong together, when they were taken, their pixels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError, resolved
from pelorus.io import arrays, foreign
from pelorus.io.foreign import ForeignFileError
from pelorus.math import motion
from pelorus.math.motion import Times
from pelorus.program.extras import extra

Gray = NDArray[np.uint8]

SUFFIXES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff")
PAIRS_MIN = 3  # an id is admitted after as many frames
ALONE_MAX = 0.1  # of the pictures may lack their partner, as in EuRoC V2_03; more is another fault
APART_NS = 2_000_000  # pictures of cameras that are triggered together
SIDE_MIN_PX = 64  # less shows no track worth having
IMAGE_BYTES_MAX = 1 << 28
NAMES_SHOWN = 3
RATES_HZ = (1e-3, 1e5)
PNG_END_BYTES = 64  # the last chunk has 12; some programs write a little behind it
DEPTH_SAMPLES = 16
NS_DIGITS = (16, 19)  # of a name that is a time in ns: from 1970 to what 63 bits hold


class Pair(NamedTuple):
    """The files of one frame."""

    left: Path
    right: Path


# --- which belong together ------------------------------------------------------------------------


def pairs(left: Path, right: Path, remarks: list[str] | None = None) -> list[Pair]:
    """By equal names, sorted; the files' endings may differ. With `remarks` a few may lack their
    partner, and that is said: for names that are times, so that the others keep theirs.
    """
    if resolved(left) == resolved(right):
        raise PelorusError(
            f"{left}: is given as the left and as the right folder; two are expected"
        )
    lefts, rights = pictures(left), pictures(right)
    alone = lefts.keys() ^ rights.keys()
    if remarks is None or too_many_alone(len(lefts.keys() & rights.keys()), len(alone)):
        _require_partners(left, lefts, right, rights)
        _require_partners(right, rights, left, lefts)
    else:
        remarks += _left_out(len(alone))
        lefts = {name: path for name, path in lefts.items() if name in rights}
    if len(lefts) < PAIRS_MIN:
        raise PelorusError(
            f"{left}: has {len(lefts)} pictures; at least {PAIRS_MIN} are expected, for a track is "
            f"admitted after {PAIRS_MIN} frames"
        )
    return [Pair(lefts[name], rights[name]) for name in _in_order(lefts)]


def _in_order(names: dict[str, Path]) -> list[str]:
    """By number where all names are numbers, for 10 comes after 9."""
    if all(name.isdecimal() for name in names):
        return sorted(names, key=lambda name: (int(name), name))
    return sorted(names)


def pictures(folder: Path) -> dict[str, Path]:
    """By name, without its ending."""
    try:
        files = sorted(p for p in folder.iterdir() if _is_picture(p))
    except OSError as error:
        raise PelorusError(
            f"{folder}: cannot be read as a folder: {error.strerror}; a folder of pictures "
            f"({', '.join(SUFFIXES)}) is expected"
        ) from error
    if not files:
        raise PelorusError(f"{folder}: holds no picture; {', '.join(SUFFIXES)} are known")
    found: dict[str, Path] = {}
    for path in files:
        if path.stem in found:
            raise PelorusError(
                f"{path}: the folder has {found[path.stem].name} too; one picture a name is "
                "expected"
            )
        found[path.stem] = path
    return found


def _is_picture(path: Path) -> bool:
    """Not what a desktop leaves beside one: ._0001.png."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def is_whole(path: Path) -> bool:
    """Not cut off, as by a copy that was broken off: a PNG ends with its last chunk."""
    end = foreign.ending(path, PNG_END_BYTES)
    return bool(end) and (path.suffix.lower() != ".png" or b"IEND" in end)


class Together(NamedTuple):
    """Indices (n, 2) of pictures that were taken together, and how many have no partner."""

    pairs: NDArray[np.intp]
    alone: int

    @property
    def remarks(self) -> list[str]:
        return _left_out(self.alone)


def together(left_ns: Times, right_ns: Times, apart_ns: int) -> Together:
    """Returns pictures that are each other's nearest in time, and near enough."""
    pairs = np.empty((0, 2), np.intp)
    if len(left_ns) and len(right_ns):
        left, right = np.arange(len(left_ns)), motion.nearest(right_ns, left_ns)
        mutual = motion.nearest(left_ns, right_ns)[right] == left
        near = np.abs(right_ns[right] - left_ns) <= apart_ns
        pairs = np.asarray(np.stack((left, right), axis=-1)[mutual & near], np.intp)
    return Together(pairs, len(left_ns) + len(right_ns) - 2 * len(pairs))


def _left_out(alone: int) -> list[str]:
    return [f"{alone} pictures have no partner and are left out"] if alone else []


def too_many_alone(pairs: int, alone: int) -> bool:
    """Whether so many pictures without a partner are another fault than some that were lost."""
    return alone > ALONE_MAX * max(pairs, 1)


def _require_partners(
    here: Path, names: dict[str, Path], there: Path, partners: dict[str, Path]
) -> None:
    alone = [path.name for name, path in names.items() if name not in partners]
    if alone:
        more = f" and {len(alone) - NAMES_SHOWN} more" if len(alone) > NAMES_SHOWN else ""
        raise PelorusError(
            f"{there}: lacks the partner of {', '.join(alone[:NAMES_SHOWN])}{more} in {here}; the "
            "two pictures of a frame must have the same name"
        )


# --- when they were taken -------------------------------------------------------------------------


def times(found: list[Pair], file: Path | None, rate_hz: float | None) -> Times:
    """ns: from the file (a time in s a row), from the rate, or from names that are ns."""
    if file is not None:
        return _times_in(file, len(found))
    if rate_hz is not None:
        if not RATES_HZ[0] <= rate_hz <= RATES_HZ[1]:
            raise PelorusError(
                f"a rate of {rate_hz:g} Hz: {RATES_HZ[0]:g} to {RATES_HZ[1]:g} is expected"
            )
        return np.round(np.arange(len(found)) * 1e9 / rate_hz).astype(np.int64)
    stems = [pair.left.stem for pair in found]
    for stem in stems:
        if not (stem.isdecimal() and NS_DIGITS[0] <= len(stem) <= NS_DIGITS[1]):
            raise PelorusError(
                f"{found[0].left.parent}: the name {stem} is no time in ns: when were the pictures "
                "taken? --times FILE (a time in s a row) or --rate HZ is expected, on the "
                "twists' clock"
            )
    if int(stems[-1]) >= 2**63:
        raise PelorusError(
            f"{found[-1].left}: the name is no time: at most {2**63 - 1} ns is expected"
        )
    t_ns = np.array([int(stem) for stem in stems], np.int64)
    if (np.diff(t_ns) <= 0).any():
        raise PelorusError(f"{found[0].left.parent}: two names are the same time in ns")
    return t_ns


def _times_in(file: Path, count: int) -> Times:
    seconds = foreign.numbers(file, foreign.rows(file), 1)[:, 0]
    if len(seconds) != count:
        raise ForeignFileError(
            file, f"has {len(seconds)} times; {count} are expected, one for each pair of pictures"
        )
    return arrays.nanoseconds(file, "time", seconds)


# --- what they show -------------------------------------------------------------------------------


def bits_of(found: Sequence[Pair], remarks: list[str]) -> int:
    """How many bits the pictures' pixels have: of 16 often the lower 10 or 12 alone are used.

    By the brightest pixel of some pictures from all over the drive. A picture of 8 bits says 16,
    for nothing is to be left out of it.
    """
    brightest = 0
    for k in np.unique(np.linspace(0, len(found) - 1, DEPTH_SAMPLES).astype(int)).tolist():
        for path in found[k]:
            pixels = unpacked(path, foreign.content(path, IMAGE_BYTES_MAX))
            if pixels.dtype == np.uint8:
                return 16
            brightest = max(brightest, int(pixels.max()))
    return bits_up_to(brightest, found[0].left.parent, remarks)


def bits_up_to(brightest: int, where: Path, remarks: list[str]) -> int:
    """Of pictures of 16 bits with this brightest pixel."""
    bits = min(max(brightest.bit_length(), 8), 16)
    if bits < 16:
        remarks.append(
            f"{where}: pictures of 16 bits hold {bits} (the brightest pixel is {brightest} of "
            "65535)"
        )
    return bits


def read(pair: Pair, shape: tuple[int, ...] | None = None, bits: int = 16) -> tuple[Gray, Gray]:
    """Left and right, both of this shape (rows, columns), else of equal shape."""
    left = gray(pair.left, bits)
    expected = left.shape if shape is None else shape
    _require_shape(pair.left, left, expected, "the first picture has")
    right = gray(pair.right, bits)
    _require_shape(pair.right, right, expected, "the left ones have")
    return left, right


def in_order(found: Iterable[Pair], bits: int = 16) -> Iterator[tuple[Gray, Gray]]:
    """Pair by pair, all of the first one's size."""
    shape = None
    for pair in found:
        left, right = read(pair, shape, bits)
        shape = left.shape
        yield left, right


def _require_shape(path: Path, image: Gray, expected: tuple[int, ...], who: str) -> None:
    if image.shape != expected:
        raise ForeignFileError(
            path, f"has {_size(image.shape)} pixels; {_size(expected)} are expected, which {who}"
        )


def require_alike(path: Path, image: Gray, first: Gray) -> None:
    """All pictures are as large as the first left one, and large enough."""
    _require_shape(path, image, first.shape, "the first picture has")
    _require_side(path, image.shape)


def require_size(path: Path, shape: tuple[int, ...], sizes: Sequence[tuple[int, int]]) -> None:
    """A picture has one of the sizes that its calibration says: (width, height), 0 if unknown."""
    known = sizes[0]
    if known[0] and (shape[1], shape[0]) not in sizes:
        raise ForeignFileError(
            path,
            f"the pictures have {_size(shape)} pixels; {known[0]} x {known[1]} are expected, for "
            "which the calibration was made",
        )


def _require_side(path: Path, shape: tuple[int, ...]) -> None:
    if min(shape) < SIDE_MIN_PX:
        raise ForeignFileError(
            path, f"has {_size(shape)} pixels; at least {SIDE_MIN_PX} x {SIDE_MIN_PX} are expected"
        )


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]}"


def gray(path: Path, bits: int = 16) -> Gray:
    """(rows, columns) of 8 bits; of 16 bits the upper eight of those that are used."""
    return decoded(path, foreign.content(path, IMAGE_BYTES_MAX), bits)


def decoded(path: Path, packed: bytes, bits: int = 16) -> Gray:
    """The same of the bytes of a picture's file; `path` is for those who read of an error."""
    pixels = unpacked(path, packed)
    if pixels.dtype != np.uint8:
        pixels = np.clip(pixels >> (bits - 8), 0, 255)
    return np.ascontiguousarray(pixels, np.uint8)


def unpacked(path: Path, packed: bytes) -> NDArray[np.integer[Any]]:
    """Of 8 bits, or of 16 in a wider type."""
    with extra("PIL"):
        from PIL import ImageFile  # noqa: PLC0415 - an extra
    try:
        parser = ImageFile.Parser()
        parser.feed(packed)
        image = parser.close()
        wide = image.mode.startswith("I")
        pixels = np.asarray(image if wide else image.convert("L"))
    except Exception as error:  # its decoders raise a dozen kinds on damaged files
        raise ForeignFileError(
            path, f"cannot be read as a picture: {error}; a whole PNG, JPEG or PGM is expected"
        ) from error
    _require_side(path, pixels.shape)
    return pixels
