"""Files of other laboratories and their tools: read and written, one module for each format."""
