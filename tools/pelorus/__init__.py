# SPDX-License-Identifier: MIT
"""Tools around Pelorus: convert, inspect, simulate and evaluate recordings."""

__version__ = "0.1.0"
