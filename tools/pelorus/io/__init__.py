# SPDX-License-Identifier: MIT
"""Recordings, trajectories and tracks in memory, and files of others: tables, arrays."""
