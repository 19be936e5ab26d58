# SPDX-License-Identifier: MIT
"""What the firmware costs, measured for docs/SIZES.md: no part of the package."""
