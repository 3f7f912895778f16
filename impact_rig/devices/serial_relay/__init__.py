"""A hammer holder that a relay on a serial port switches."""
