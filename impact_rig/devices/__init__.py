"""Hammer holders and acceleration sources, virtual and real."""
