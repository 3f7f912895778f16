"""What blueprint and logging agree on: entity paths, timelines and colours."""

APPLICATION = "impact_rig"
"""Rerun's application id: viewers keep a user's own layout under it."""

HIT_TIME = "hit_time"
"""Timeline: time inside a hit. Plots live on it; a record begins, and in comparisons the contact
begins, at 0."""
HIT = "hit"
"""Timeline: number of the record."""
WALL_CLOCK = "wall_clock"
"""Timeline: time of day."""

HITS = ("hits",)
"""Parent of one entity per hit: its hammer and sample traces."""
VERDICT = ("verdict",)
"""The last hit in words."""
COMPARISONS = ("comparisons",)
"""Parent of model / sample / version: four traces, and the contact."""
TABLE = ("results",)
"""Measured values beside reference values."""
LOG = ("log",)
"""One line per verdict."""

DRIVEN = "driven"
"""Equation (4) on the hammer, the sample driven by F(t) alone."""
PRINTED = "printed"
"""Equations (1) and (2) as they stand."""

# Okabe and Ito's palette: told apart by colour-blind readers, and on dark and light ground.
Colour = tuple[int, int, int]
HAMMER_COLOUR: Colour = (86, 180, 233)
HAMMER_MODEL_COLOUR: Colour = (0, 114, 178)
SPECIMEN_COLOUR: Colour = (230, 159, 0)
SPECIMEN_MODEL_COLOUR: Colour = (213, 94, 0)
CONTACT_COLOUR: Colour = (0, 158, 115)
EARLIER_COLOUR: Colour = (128, 128, 128)

EARLIER = "earlier"
"""Name of everything superseded: hidden, and shown again by a click on it in the legend."""
