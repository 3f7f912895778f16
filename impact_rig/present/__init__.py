"""Results for people: in a terminal, in a report, in figures, in the viewer Rerun."""
