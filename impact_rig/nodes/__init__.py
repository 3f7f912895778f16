"""ROS 2 nodes of the rig: thin, each its own process; rclpy is imported only here."""
