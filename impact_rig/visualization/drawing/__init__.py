"""What is drawn and written: plots, figures, tables, words."""
