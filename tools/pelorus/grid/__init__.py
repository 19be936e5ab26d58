# SPDX-License-Identifier: MIT
"""`pelorus map`: where a drive shows that the ground is free, and where it is occupied."""
