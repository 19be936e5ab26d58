# SPDX-License-Identifier: MIT
"""Live odometry without ROS: a camera in, a pose out, by the pipeline of pelorus.online."""
