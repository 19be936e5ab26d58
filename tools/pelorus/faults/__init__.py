# SPDX-License-Identifier: MIT
"""Detects faults of a recording from its own data, and mends some of them."""
