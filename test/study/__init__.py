"""The estimators on simulated hits, where the truth is known: bias, coverage, false rejections."""
