# SPDX-License-Identifier: MIT
"""The format of recordings and links (docs/REPLAY-FORMAT.md): messages, their bytes, and frames."""
