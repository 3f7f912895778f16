"""A recording in place of accelerometers: its hits come again."""
