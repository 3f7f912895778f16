"""Results of a campaign, for people and programs: numbers, traces, figures, results.json."""
