# SPDX-License-Identifier: MIT
"""Shows a log in three dimensions and over time, in Rerun and Foxglove."""
