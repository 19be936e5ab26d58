# SPDX-License-Identifier: MIT
"""The other end of the link: streaming a recording to a board, real or emulated."""
