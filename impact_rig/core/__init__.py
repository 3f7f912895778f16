"""Impact physics and estimation: numpy and scipy only, no I/O, no clock, no ROS."""
