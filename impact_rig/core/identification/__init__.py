"""The two-body model fitted to both traces, and the bound on how well that can be done."""
