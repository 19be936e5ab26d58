# SPDX-License-Identifier: MIT
"""Pelorus as a node of ROS 2. Only `node` imports rclpy; messages are taken by their fields."""

import os

# Before numpy is imported: on matrices as small as these its threads cost more than they gain, and
# wait for each other at full speed.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
