"""Colours and markers of all pictures.

The colours are Okabe and Ito's, for colour-blind readers, on dark and light ground.
What differs in colour differs in marker, line or place as well.
"""

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

ORANGE: Colour = (230, 159, 0)
SKY_BLUE: Colour = (86, 180, 233)
GREEN: Colour = (0, 158, 115)
BLUE: Colour = (0, 114, 178)
VERMILION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
GREY: Colour = (128, 128, 128)

HAMMER = SKY_BLUE
HAMMER_MODEL = BLUE
SPECIMEN = ORANGE
SPECIMEN_MODEL = VERMILION
CONTACT = GREEN

SERIES: tuple[Colour, ...] = (BLUE, VERMILION, GREEN, PURPLE, GREY)
"""Colours of lines and points on white or black ground: contrast 3:1 (WCAG 2.2, 1.4.11)."""


def format_hex(colour: Colour) -> str:
    """Return a colour as ``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
