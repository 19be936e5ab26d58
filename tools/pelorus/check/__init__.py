# SPDX-License-Identifier: MIT
"""`pelorus check`: a verdict on a recording without truth, and the settings that suit it."""
