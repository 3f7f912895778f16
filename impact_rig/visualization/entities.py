"""What blueprint and logging agree on: entity paths and timelines."""

APPLICATION = "impact_rig"
"""Rerun's application id: viewers keep a user's own layout under it."""

HIT_TIME = "hit_time"
"""Timeline: time inside a hit. Plots live on it. 0 is the first point of a record, and in what is
laid over each other the middle of the hammer pulse; in Figs. 3 and 4 it is the pulse width."""
HIT = "hit"
"""Timeline: number of the record."""
WALL_CLOCK = "wall_clock"
"""Timeline: time of day."""

Path = tuple[str, ...]
"""An entity path, part by part: names of samples may contain anything."""

HITS: Path = ("hits",)
"""Parent of one entity per record: its hammer and sample traces."""
VERDICT: Path = ("verdict",)
"""The last hit in words."""
SAMPLES: Path = ("samples",)
"""Parent of sample / body / what is laid over each other."""
FIGURES: Path = ("figures",)
"""Parent of the paper's figures, by number."""
TABLES: Path = ("results",)
"""Everything found, in tables."""
LOG: Path = ("log",)
"""One line per verdict."""
TRENDS: Path = ("trends",)
"""Contact time and peaks of each hit, over the number of the hit and the time of day."""
HEALTH: Path = ("health",)
"""What the nodes say of themselves."""

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
"""Below a body: parent of mean, model and residual, one for each way to calculate the model."""
POINTS = "points"
"""Below a body: what was read from the mean."""
SUMMARY = "summary"
"""Below a sample: what was found of it, in words."""


def find_body(sample: str, body: str) -> Path:
    """Return the parent of what is drawn of one body of a sample's hits."""
    return (*SAMPLES, sample, body)
