"""Results in a terminal: tables, remarks, colour."""
