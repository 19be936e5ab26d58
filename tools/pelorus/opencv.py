# SPDX-License-Identifier: MIT
"""OpenCV, loaded where something of it is first used: it is an extra of the package, and takes
longer to load than most commands to run.
"""

from typing import TYPE_CHECKING, Any

from pelorus.errors import PelorusError

__all__ = ["cv2"]

if TYPE_CHECKING:
    import cv2
else:

    class _OpenCV:
        def __getattr__(self, name: str) -> Any:
            try:
                import cv2  # noqa: PLC0415 - see above
            except ImportError as error:
                raise PelorusError(
                    "pictures need OpenCV, which is missing: pip install 'pelorus[vision]'"
                ) from error
            return getattr(cv2, name)

    cv2 = _OpenCV()
