# SPDX-License-Identifier: MIT
"""A seeded drive through a field of landmarks, seen by a stereo camera.

Only additions, multiplications, divisions and square roots are used (no matrix library, no
sine), and numpy's PCG64 for chance, so that a seed gives the same bytes everywhere.
"""
