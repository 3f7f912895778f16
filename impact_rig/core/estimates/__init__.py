"""What is estimated from a mean: the paper's method, contact law, free decay, model, checks."""
