"""An operator who holds the hammer and lets it go."""
