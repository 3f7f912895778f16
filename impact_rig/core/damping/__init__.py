"""Damping of one body, by the log decrement and by the free decay."""
