# SPDX-License-Identifier: MIT
"""Optional packages, which together are larger than all else, imported at first use.

Where one is missing the user is told which extra installs it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from pelorus.errors import PelorusError
from pelorus.program.distribution import pip_install

__all__ = ["cv2", "extra", "figures_missing"]

# By the imported name: what needs it, and its extra.
EXTRAS = {
    "cv2": ("pictures need OpenCV", "vision"),
    "PIL": ("pictures need Pillow", "vision"),
    "matplotlib": ("drawings (.png) need matplotlib", "figures"),
    "rosbags": ("bags need rosbags", "ros"),
    "pyulog": ("logs of PX4 need pyulog", "px4"),
    "pymavlink": ("MAVLink needs pymavlink", "mavlink"),
    "depthai": ("an OAK needs depthai", "oak"),
    "pyrealsense2": ("a RealSense needs pyrealsense2", "realsense"),
    "distributed": ("a fleet needs Dask", "fleet"),
    "duckdb": ("a fleet's table needs DuckDB", "fleet"),
    "rerun": ("this needs rerun", "view"),
    "foxglove": ("this needs foxglove", "view"),
    "pyproj": ("places on the earth need pyproj", "geodetic"),
}


def _missing(package: str) -> str:
    needs, name = EXTRAS[package]
    return f"{needs}, which is missing: {pip_install(name)}"


@contextmanager
def extra(package: str) -> Iterator[None]:
    """Guards the imports of an optional package."""
    try:
        yield
    except ImportError as error:
        raise PelorusError(_missing(package)) from error


def figures_missing() -> str:
    """Returns a remark on drawings that are left out; empty where they can be made."""
    return "" if find_spec("matplotlib") else _missing("matplotlib")


if TYPE_CHECKING:
    import cv2
else:

    class _OpenCV:
        def __getattr__(self, name: str) -> Any:
            with extra("cv2"):
                import cv2  # noqa: PLC0415 - it takes longer to load than most commands to run
            return getattr(cv2, name)

    cv2 = _OpenCV()
