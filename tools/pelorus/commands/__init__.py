# SPDX-License-Identifier: MIT
"""One file a command, with an `app` that has it."""
