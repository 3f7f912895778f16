"""What the hammer node consists of."""
