# SPDX-License-Identifier: MIT
"""One file for each command, with an `app` that has it."""
