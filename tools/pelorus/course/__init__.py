# SPDX-License-Identifier: MIT
"""`pelorus course`: the course report's figures and comparison, made anew (docs/COURSE.md)."""
