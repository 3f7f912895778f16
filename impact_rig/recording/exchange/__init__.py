"""Measurements of other instruments become recordings, and recordings measurements."""
