# SPDX-License-Identifier: MIT
"""Rigid motions, dead reckoning, readings of an IMU, and errors against covariances."""
