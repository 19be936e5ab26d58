# SPDX-License-Identifier: MIT
"""The node beside a RealSense D435i: ros2 launch examples/ros2/robot.launch.py.

Another camera has other topics: they stand in `TOPICS`, and nowhere else.
"""

from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
TOPICS = {
    "left/image": "/camera/infra1/image_rect_raw",
    "left/camera_info": "/camera/infra1/camera_info",
    "right/image": "/camera/infra2/image_rect_raw",
    "right/camera_info": "/camera/infra2/camera_info",
    "imu": "/camera/imu",
}


def generate_launch_description() -> LaunchDescription:
    """Returns the node, whose pictures are rectified by the camera."""
    node = Node(
        package="pelorus_ros",
        executable="pelorus_node",
        name="pelorus",
        output="screen",
        parameters=[str(HERE / "robot.yaml"), {"rectified": True}],
        remappings=list(TOPICS.items()),
    )
    return LaunchDescription([node])
