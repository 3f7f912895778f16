"""How the command line takes hits for a calibration, and what it shows of it."""
