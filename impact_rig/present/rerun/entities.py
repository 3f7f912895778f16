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
HEALTH: Path = ("health", "now")
"""What the nodes say of themselves."""
HEALTH_HISTORY: Path = ("health", "history")
"""Parent of kind / node / figure: what of it is followed over the time of day."""

CONTACT_TIME = "contact_time"
HAMMER_PEAK = "hammer_peak"
SPECIMEN_PEAK = "sample_peak"
"""Below the trends: what is followed over the hits."""

FIGURE_3: Path = (*FIGURES, "3")
FIGURE_4: Path = (*FIGURES, "4")
FIGURE_5: Path = (*FIGURES, "5")
FIGURE_6: Path = (*FIGURES, "6")
"""Below Figs. 4 and 6 hammer and sample, below Fig. 5 the samples by name."""

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
AS_PRINTED = "printed"
"""Below a sample: mean, model as printed and residual of both bodies."""
POINTS = "points"
"""Below a body: what was read from the mean."""
LAW, LAW_RESIDUAL, LOOP = "law", "law residual", "loop"
"""Below a sample: its contact's pulse, what law and versed-sine leave of it, its loop."""
SUMMARY = "summary"
"""Below a sample: what was found of it, in words."""


def make_body_path(sample: str, part: str) -> Path:
    """Return the parent of what is drawn of a sample: of one body, or of its contact."""
    return (*SAMPLES, sample, part)
