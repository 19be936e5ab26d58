# SPDX-License-Identifier: MIT
"""One file a source format: read it, check it, hand it back as a Recording."""
