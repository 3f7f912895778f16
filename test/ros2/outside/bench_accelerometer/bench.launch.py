"""A rig that takes a foreign node's samples: `ros2 launch bench_accelerometer bench.launch.py`."""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

RIG = PathJoinSubstitution([FindPackageShare("impact_rig"), "launch", "rig.launch.py"])
BENCH = PathJoinSubstitution([FindPackageShare("bench_accelerometer"), "bench.toml"])


def generate_launch_description():
    """Return the foreign node, and a rig that takes its samples."""
    arguments = {"rig_file": BENCH, "visualizer": "false"}
    rig = IncludeLaunchDescription(RIG, launch_arguments=arguments.items())
    return LaunchDescription([Node(package="bench_accelerometer", executable="samples"), rig])
