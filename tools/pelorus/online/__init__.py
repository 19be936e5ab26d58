# SPDX-License-Identifier: MIT
"""The filter on a robot: data as they come, in any order, to estimates and a log."""
