"""Sound cards and accelerometers that look like one, by PortAudio."""
