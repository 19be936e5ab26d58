# SPDX-License-Identifier: MIT
"""The one exception that the commands turn into a message and an exit status."""


class PelorusError(Exception):
    """Says what is wrong, where, and what would be right."""
