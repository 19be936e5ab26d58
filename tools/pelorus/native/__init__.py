# SPDX-License-Identifier: MIT
"""The library in C and the replay programs: where they are, their structs, and one run of them."""
