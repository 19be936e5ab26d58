# SPDX-License-Identifier: MIT
"""A log in three dimensions and over time, in viewers that robots' users have: Rerun, Foxglove."""
