"""Results for people and programs: tables in a terminal, and results.json."""
