# SPDX-License-Identifier: MIT
"""Compares a robot's log with the desk: what it computed, and what a replay computes."""
