"""From mean traces to contact time, stiffness and damping."""
