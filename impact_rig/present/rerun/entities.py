"""Entity paths and timelines, for blueprint and logging."""

APPLICATION = "impact_rig"
"""Rerun's application id: viewers keep a user's own layout under it."""

HIT_TIME = "hit_time"
"""Timeline of all plots, since a viewer shows one at a time: time inside a hit. 0 is the first
point of a record; for traces on one time axis it is the middle of the hammer pulse. What is shown
over the hits has a second for each hit.
"""
HIT = "hit"
"""Timeline: number of the record."""
WALL_CLOCK = "wall_clock"
"""Timeline: time of day."""

Path = tuple[str, ...]
"""An entity path, part by part: names of samples may contain anything."""

HITS: Path = ("hits",)
"""Parent of one entity per record: its hammer and sample traces."""
VERDICT: Path = ("verdict",)
"""Text on the last hit."""
SAMPLES: Path = ("samples",)
"""Parent of sample / body / traces on one time axis."""
TABLES: Path = ("results",)
"""The tables of results."""
LOG: Path = ("log",)
"""One line per verdict."""
TRENDS: Path = ("trends",)
"""Contact time and peaks of each hit."""

CONTACT_TIME = "contact_time"
HAMMER_PEAK = "hammer_peak"
SPECIMEN_PEAK = "sample_peak"
"""Below the trends: quantities of each hit."""

HAMMER = "hammer"
SPECIMEN = "sample"
BODIES = (HAMMER, SPECIMEN)
"""The two bodies of a hit, in the order of the traces."""

# Plots draw in the order of the names: contact below, points on top.
CONTACT = "contact"
"""Below a body: its contact window."""
OVERLAY = "hits"
"""Below a body: all hits."""
MODELS = "models"
"""Below a body: mean, models and residual."""
POINTS = "points"
"""Below a body: marks on the mean."""
LAW, LAW_RESIDUAL = "law", "law residual"
"""Below a sample: its contact's pulse, and the residuals of law and versed-sine."""
SUMMARY = "summary"
"""Below a sample: its results as text."""


def make_body_path(sample: str, part: str) -> Path:
    """Return the parent of a sample's plots: of one body, or of its contact."""
    return (*SAMPLES, sample, part)
