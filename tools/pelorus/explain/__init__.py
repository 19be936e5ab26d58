# SPDX-License-Identifier: MIT
"""What went wrong on a drive, when, and what was seen before it: `pelorus explain`."""

from pelorus.explain.explanation import Explanation, explain

__all__ = ["Explanation", "explain"]
