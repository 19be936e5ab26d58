# SPDX-License-Identifier: MIT
"""Tools around Pelorus: convert, inspect, simulate and evaluate recordings."""

__version__ = "0.1.0"
ARITHMETIC = 21  # PLR_ARITHMETIC of the library that these tools belong to
