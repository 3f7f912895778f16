"""MCAP recordings and plain traces in and out; no rclpy."""
