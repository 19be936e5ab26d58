# SPDX-License-Identifier: MIT
"""`pelorus fleet`: check, evaluate and explain over hundreds of recordings."""
