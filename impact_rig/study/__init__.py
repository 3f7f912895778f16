"""The bias study: the estimators over the virtual rig, where the truth is known."""
