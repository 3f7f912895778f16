"""Recordings are written, onto the disk for certain."""
