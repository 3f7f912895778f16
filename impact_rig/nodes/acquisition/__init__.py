"""What the accelerometer node is made of."""
