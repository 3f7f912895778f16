"""The report's figures, as SVG in the text colour of the page."""
