# SPDX-License-Identifier: MIT
"""Which front end follows the pictures: the library's own eyes, or OpenCV's tracker."""

from typing import Literal, get_args

Kind = Literal["own", "opencv"]
KINDS: tuple[str, ...] = get_args(Kind)
