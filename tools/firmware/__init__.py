# SPDX-License-Identifier: MIT
"""Measures the firmware for docs/SIZES.md; it is not part of the package."""
