# SPDX-License-Identifier: MIT
"""Importers, one file a source format: each reads and checks it, and returns a Recording."""
