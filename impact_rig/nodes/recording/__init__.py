"""What the recorder is made of, and what waits for it."""
