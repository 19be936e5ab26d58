# SPDX-License-Identifier: MIT
"""A robot's log against the desk: what it computed then, and what a replay computes now."""
