"""A hammer holder on a pin of the computer itself."""
