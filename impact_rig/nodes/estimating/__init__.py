"""What the estimator is made of."""
