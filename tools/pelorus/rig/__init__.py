# SPDX-License-Identifier: MIT
"""A stereo camera on a body as somebody else's calibration describes it, and its rectification."""
