# SPDX-License-Identifier: MIT
"""`pelorus course`: reproduces the course report's figures and comparison (docs/COURSE.md)."""
