"""From recordings and plain traces to results, one or many at a time."""
