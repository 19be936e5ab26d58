# SPDX-License-Identifier: MIT
"""UCSD's course ECE276A, for the command pelorus: files and figures (docs/COURSE.md)."""
