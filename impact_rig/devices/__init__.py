"""What touches the world: hammer holders and acceleration sources, virtual and real."""
