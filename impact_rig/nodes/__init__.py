"""ROS 2 nodes of the rig: thin, each its own process; rclpy is imported only here."""

from impact_rig.configuration.processes import use_one_thread

use_one_thread()
