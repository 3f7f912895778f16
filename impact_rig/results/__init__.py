"""What a campaign found, for people and programs alike: numbers, traces, figures, results.json."""
