"""The impact rig: contact time, stiffness and damping of metal samples from hammer impacts."""

__version__ = "0.1.0"
