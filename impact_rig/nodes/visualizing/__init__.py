"""What the visualizer is made of."""
