# SPDX-License-Identifier: MIT
"""Places on the earth as metres east, north and up of an origin, by PROJ (pyproj).

Columns lat_deg and lon_deg are of WGS 84, unless --crs names another datum; easting_m and
northing_m are of the grid that --crs names (EPSG:32632 is zone 32 north of UTM on WGS 84). alt_m is
the height above the ellipsoid, or above the sea: only its differences count.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.table import Table
from pelorus.program.extras import extra
from pelorus.wire.layout import Floats

if TYPE_CHECKING:
    from pyproj import CRS

DEGREES, GRID, HEIGHT = ("lon_deg", "lat_deg"), ("easting_m", "northing_m"), "alt_m"
LOCAL = ("px_m", "py_m", "pz_m")
WGS84, GEOCENTRIC = "EPSG:4326", "EPSG:4978"
AXES = "+proj=topocentric +ellps=WGS84"
LOCAL_MAX_M = 1e5  # farther off, east and north are no plane's


@dataclass
class Ground:
    """The ground of all files: `crs` is the user's, the origin is the first place read."""

    crs: str = ""
    origin_m: Floats | None = None  # geocentric

    def local(self, path: Path, places: Floats, remarks: list[str]) -> Floats:
        """Returns (n, 3) m east, north, up of (longitude, latitude or easting, northing;
        height).
        """
        crs = self.system()
        from pyproj import Transformer  # noqa: PLC0415 - an extra

        to_centre = Transformer.from_crs(crs.to_3d(), GEOCENTRIC, always_xy=True)
        centred = np.stack(to_centre.transform(*places.T), axis=-1)
        if not np.isfinite(centred).all():
            k = int(np.argmin(np.isfinite(centred).all(axis=1)))
            raise ForeignFileError(path, f"{places[k][:2].tolist()} is no place in {crs.name}")
        if self.origin_m is None:
            self.origin_m = centred[0]
        x, y, z = self.origin_m.tolist()
        plane = Transformer.from_pipeline(f"{AXES} +X_0={x!r} +Y_0={y!r} +Z_0={z!r}")
        found = np.stack(plane.transform(*centred.T), axis=-1)
        if np.abs(found).max() > LOCAL_MAX_M:
            raise ForeignFileError(
                path,
                f"a place lies {np.abs(found).max() * 1e-3:.4g} km from the first one; at most "
                f"{LOCAL_MAX_M * 1e-3:g} km are expected: is there a row without a fix?",
            )
        remarks.append(
            f"{path}: places in {crs.name} become metres east, north and up of the first one "
            f"({', '.join(f'{value:.7g}' for value in places[0])})"
        )
        return found

    def system(self) -> CRS:
        """Returns the coordinate system of the numbers."""
        with extra("pyproj"):
            from pyproj import CRS  # noqa: PLC0415 - an extra
            from pyproj.exceptions import CRSError, ProjError  # noqa: PLC0415

        try:
            return CRS.from_user_input(self.crs or WGS84)
        except (CRSError, ProjError):
            raise PelorusError(
                f"--crs {self.crs}: is not known; such as EPSG:32632 is expected, zone 32 "
                "north of UTM"
            ) from None


def localise(table: Table, ground: Ground) -> None:
    """Gives a table with places on the earth the columns of local metres."""
    if any(map(table.has, LOCAL)):
        return
    by_degrees = all(map(table.has, DEGREES))
    names: tuple[str, ...] = DEGREES if by_degrees else GRID
    if not all(map(table.has, names)):
        return
    if not by_degrees and not ground.crs:
        raise ForeignFileError(
            table.path,
            f"{' and '.join(GRID)}: in which grid?; --crs EPSG:326NN is expected for zone NN north "
            "of UTM on WGS 84, EPSG:327NN for south",
        )
    if by_degrees != (ground.system().is_geographic if ground.crs else True):
        raise ForeignFileError(table.path, f"has {' and '.join(names)}, and --crs is {ground.crs}")
    if table.has(HEIGHT):
        names = (*names, HEIGHT)
    table.leave_out_bad(*names)
    places = np.zeros((table.count, 3))
    places[:, : len(names)] = table.numbers(*names)
    local = ground.local(table.path, places, table.remarks)
    for name, numbers in zip(LOCAL[: len(names)], local.T[: len(names)], strict=True):
        table.put(name, numbers)
