# SPDX-License-Identifier: MIT
"""Pelorus as a node of ROS 2. Only `node` imports rclpy; messages are taken by their fields."""
