"""Rerun's viewers: addresses, program, a relay for our own, ways to those elsewhere."""
