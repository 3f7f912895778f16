"""Identified contacts as parameters of multibody engines, and the proof in these engines."""
