"""Results for people in a terminal: tables, remarks, colour where it is to be had."""
