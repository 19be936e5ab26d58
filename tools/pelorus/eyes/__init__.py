# SPDX-License-Identifier: MIT
"""The front end at the desk: points followed through pairs of pictures."""
