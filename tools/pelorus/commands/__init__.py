# SPDX-License-Identifier: MIT
"""One file a command: `register(app)` adds it."""
