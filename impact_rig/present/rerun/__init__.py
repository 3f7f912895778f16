"""Model against measurement in Rerun: logging, blueprint, and where the view goes."""
