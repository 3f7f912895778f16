"""Recordings are found and read: one MCAP file, or a folder as rosbag2 writes it."""
