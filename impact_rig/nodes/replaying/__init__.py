"""What the replayer is made of."""
