# SPDX-License-Identifier: MIT
"""`pelorus report` compares several replays of one recording in pictures, a table and words."""
