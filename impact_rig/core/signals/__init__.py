"""Blocks of counts, records cut out of the stream, and the low-pass."""
