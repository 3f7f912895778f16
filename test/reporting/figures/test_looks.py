import itertools

import pytest

from impact_rig.reporting.figures import sample_panel
from impact_rig.reporting.figures.figure_5 import LOOKS as FIGURE_5_LOOKS
from impact_rig.reporting.figures.looks import SERIES_COLOURS, find_looks, find_marker
from impact_rig.reporting.figures.style import INK
from impact_rig.results.palette import MATERIALS, format_hex

GROUNDS = ("#ffffff", "#111111")
DRAWN = {
    *map(format_hex, SERIES_COLOURS),
    *(look["color"] for look in FIGURE_5_LOOKS.values()),
    *(look["color"] for look in sample_panel.LOOKS.values()),
} - {INK}


def compute_luminance(colour: str) -> float:
    """Relative luminance as WCAG 2.2 defines it."""
    channels = [int(colour[place : place + 2], 16) / 255.0 for place in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def compute_contrast(one: str, other: str) -> float:
    low, high = sorted((compute_luminance(one), compute_luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_the_contrast_is_measured_as_wcag_does():
    assert compute_contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert compute_contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("colour", sorted(DRAWN))
def test_every_colour_stands_out_from_a_light_and_from_a_dark_page(colour, ground):
    assert compute_contrast(colour, ground) >= 3.0


def test_materials_have_the_colours_of_all_other_pictures_where_those_can_be_seen():
    assert SERIES_COLOURS[:4] == MATERIALS[:4]


def test_materials_of_different_colour_have_different_dashes():
    looks = find_looks(["aluminium", "steel", "bronze", "brass"]).values()
    for one, other in itertools.combinations(looks, 2):
        assert one.colour != other.colour
        assert one.dashes != other.dashes


def test_twenty_materials_are_told_apart():
    looks = find_looks([f"alloy {place}" for place in range(20)]).values()
    assert len({(look.colour, str(look.dashes)) for look in looks}) == 20


def test_sizes_are_squares_triangles_and_stars_as_in_the_paper():
    assert [find_marker(size)["marker"] for size in range(3)] == ["s", "^", "*"]


def test_models_differ_in_dashes_as_well_as_in_colour():
    looks = sample_panel.LOOKS.values()
    assert len({look["color"] for look in looks}) == len(looks)
    assert len({str(look["linestyle"]) for look in looks}) == len(looks)
