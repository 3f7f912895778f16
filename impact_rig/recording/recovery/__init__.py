"""Recordings are looked through, sound or damaged, and made good again."""
