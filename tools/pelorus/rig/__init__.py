# SPDX-License-Identifier: MIT
"""A stereo camera on a body, by any program's calibration, and its rectification."""
