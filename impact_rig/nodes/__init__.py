"""ROS 2 nodes of the rig: thin, each its own process; rclpy is imported only here."""

import os

# Six nodes share the host's cores: numerical libraries that start a thread for each core, and let
# them spin, take the time from each other. Read when numpy is imported, so it is set before.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
