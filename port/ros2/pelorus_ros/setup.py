# SPDX-License-Identifier: MIT
"""An ament_python package; `pip install port/ros2/pelorus_ros` takes it as well."""

from glob import glob

from setuptools import setup

NAME = "pelorus_ros"

setup(
    name=NAME,
    version="0.1.0",
    description="Stereo visual-inertial odometry with an honest covariance, as a node",
    license="MIT",
    packages=[NAME],
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
    ],
    entry_points={"console_scripts": [f"pelorus_node = {NAME}.node:main"]},
)
