"""For `launch_test`: the launched rig runs one campaign by itself and ends, all of it well."""

import unittest

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare
from launch_testing import post_shutdown_test
from launch_testing.actions import ReadyToTest
from launch_testing.asserts import assertExitCodes, assertInStdout


def generate_test_description():
    """Return the launch file as it is installed, in a namespace, with a single-file recording."""
    arguments = ("output", "params_file")
    rig = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([FindPackageShare("impact_rig"), "launch", "rig.launch.py"])
        ),
        launch_arguments={
            "impacts": "1",
            "namespace": "other",
            "visualizer": "false",
            **{name: LaunchConfiguration(name) for name in arguments},
        }.items(),
    )
    declared = [DeclareLaunchArgument(name) for name in arguments]
    return LaunchDescription([*declared, rig, ReadyToTest()])


class TestCampaign(unittest.TestCase):
    """While it runs."""

    def test_it_ends_by_itself(self, proc_info):
        proc_info.assertWaitForShutdown("impact-rig", timeout=200)


@post_shutdown_test()
class TestEnd(unittest.TestCase):
    """When all have ended."""

    def test_tables_were_printed(self, proc_output):
        assertInStdout(proc_output, "Contact time, stiffness, damping", "impact-rig")

    def test_every_process_ended_well(self, proc_info):
        assertExitCodes(proc_info)
