"""Rigs and replays run by a command: processes, progress, questions."""
