"""What `info`, `recover` and `export` are made of."""
