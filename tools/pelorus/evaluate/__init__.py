# SPDX-License-Identifier: MIT
"""The figures of recordings and results: against the truth, over time, and of their content."""
