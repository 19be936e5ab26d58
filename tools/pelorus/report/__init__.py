# SPDX-License-Identifier: MIT
"""`pelorus report`: several replays of one recording, compared in pictures, a table and words."""
