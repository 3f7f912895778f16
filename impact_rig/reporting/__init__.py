"""Results for people: in a terminal, in figures, in a report."""
