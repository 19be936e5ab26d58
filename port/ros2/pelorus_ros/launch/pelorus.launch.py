# SPDX-License-Identifier: MIT
"""ros2 launch pelorus_ros pelorus.launch.py params:=robot.yaml left:=/cam0/image_raw ..."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

TOPICS = {
    "left": ("left/image", "/left/image_raw"),
    "left_info": ("left/camera_info", "/left/camera_info"),
    "right": ("right/image", "/right/image_raw"),
    "right_info": ("right/camera_info", "/right/camera_info"),
    "imu": ("imu", "/imu"),
    "wheels": ("wheels", "/wheel/odometry"),
    "odom": ("odom", "odom"),
}


def generate_launch_description() -> LaunchDescription:
    """Returns the node with its topics as arguments."""
    arguments = [
        DeclareLaunchArgument("params", description="YAML file of the node's parameters"),
        DeclareLaunchArgument("use_sim_time", default_value="false"),
        *(
            DeclareLaunchArgument(name, default_value=usual, description=f"topic for {topic}")
            for name, (topic, usual) in TOPICS.items()
        ),
    ]
    node = Node(
        package="pelorus_ros",
        executable="pelorus_node",
        name="pelorus",
        output="screen",
        parameters=[
            LaunchConfiguration("params"),
            {"use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
        remappings=[(topic, LaunchConfiguration(name)) for name, (topic, _) in TOPICS.items()],
    )
    return LaunchDescription([*arguments, node])
