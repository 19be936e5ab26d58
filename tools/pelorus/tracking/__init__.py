# SPDX-License-Identifier: MIT
"""From rectified stereo pictures to stereo tracks: pelorus track."""
