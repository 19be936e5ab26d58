# SPDX-License-Identifier: MIT
"""A tracker of OpenCV's corners and Lucas-Kanade flow: the judge of the library's own eyes."""
