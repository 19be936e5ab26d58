# SPDX-License-Identifier: MIT
"""Pictures in folders, and what stereo tracks show of the camera's motion."""
