"""Uncertainty by the GUM: inputs, propagation, budgets."""
