"""The parts of the bench, one module each, which offers it as `PART`."""
