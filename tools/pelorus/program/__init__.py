# SPDX-License-Identifier: MIT
"""What every program of the package needs: its console, optional packages, one look of pictures."""
