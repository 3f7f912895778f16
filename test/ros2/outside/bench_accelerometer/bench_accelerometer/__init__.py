"""Samples of a bench."""
