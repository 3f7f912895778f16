"""The same with launch_testing: `launch_test check_rig.launch.py`."""

import unittest

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare
from launch_testing import post_shutdown_test
from launch_testing.actions import ReadyToTest
from launch_testing.asserts import assertExitCodes

RIG = PathJoinSubstitution([FindPackageShare("impact_rig"), "launch", "rig.launch.py"])


def generate_test_description():
    arguments = {"visualizer": "false", "seed": "7", "namespace": "checked"}
    rig = IncludeLaunchDescription(RIG, launch_arguments=arguments.items())
    return LaunchDescription([rig, ReadyToTest()])


class TestRig(unittest.TestCase):
    def test_it_records(self, proc_output):
        proc_output.assertWaitFor("recording to ", timeout=60.0)


@post_shutdown_test()
class TestEnd(unittest.TestCase):
    def test_every_node_ended_cleanly(self, proc_info):
        assertExitCodes(proc_info)
