# SPDX-License-Identifier: MIT
"""Faults of a recording that its own data give away, and their remedies."""
