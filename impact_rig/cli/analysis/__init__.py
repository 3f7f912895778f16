"""What `analyze` and `import` are made of."""
