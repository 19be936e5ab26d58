# SPDX-License-Identifier: MIT
"""Streams a recording to a board, real or emulated."""
