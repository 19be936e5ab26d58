# SPDX-License-Identifier: MIT
"""Shows a log in three dimensions and over time, in viewers that robots' users have: Rerun,
Foxglove.
"""
