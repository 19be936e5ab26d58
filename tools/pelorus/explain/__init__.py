# SPDX-License-Identifier: MIT
"""`pelorus explain`: what went wrong on a drive, when, and what was seen before it."""

from pelorus.explain.explanation import Explanation, explain

__all__ = ["Explanation", "explain"]
