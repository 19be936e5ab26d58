# SPDX-License-Identifier: MIT
"""`pelorus map`: what a drive says about where the ground is free and where something stands."""
