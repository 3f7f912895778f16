"""Measures what is claimed: each figure against its peer or its limit, in the same run."""
