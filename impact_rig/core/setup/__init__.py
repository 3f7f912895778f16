"""What is known before the first hit: samples, masses, settings, the published campaign."""
