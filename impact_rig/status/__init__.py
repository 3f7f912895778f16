"""The state of a rig, kept apart from ROS and from any display."""
