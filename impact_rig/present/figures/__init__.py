"""The report's figures: vector graphics that take their ink from the page they stand on."""
