import itertools
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.present.figures.panels import (
    INK,
    LONGEST_NAME,
    SERIES_COLOURS,
    choose_looks,
    choose_marker,
    shorten_name,
)
from impact_rig.present.figures.paper_figures import LOOKS_5
from impact_rig.present.figures.sample_figure import LOOKS
from impact_rig.results.palette import format_hex

from ..contrast import compute_contrast

GROUNDS = ((0xFF, 0xFF, 0xFF), (0x11, 0x11, 0x11))
DRAWN = {
    *map(format_hex, SERIES_COLOURS),
    *(look["color"] for look in LOOKS_5.values()),
    *(look["color"] for look in LOOKS.values()),
} - {INK}


def test_the_contrast_is_measured_as_wcag_does():
    assert compute_contrast((0, 0, 0), (255, 255, 255)) == pytest.approx(21.0)
    assert compute_contrast((0x77,) * 3, (255,) * 3) == pytest.approx(4.48, abs=0.005)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("colour", sorted(DRAWN))
def test_every_colour_stands_out_from_a_light_and_from_a_dark_page(colour, ground):
    assert compute_contrast(bytes.fromhex(colour[1:]), ground) >= 3.0


def test_materials_of_different_colour_have_different_dashes():
    looks = choose_looks(["aluminium", "steel", "bronze", "brass"]).values()
    for one, other in itertools.combinations(looks, 2):
        assert one.colour != other.colour
        assert one.dashes != other.dashes


def test_sizes_are_squares_triangles_and_stars_as_in_the_paper():
    assert [choose_marker(size)["marker"] for size in range(3)] == ["s", "^", "*"]


def test_models_differ_in_dashes_as_well_as_in_colour():
    looks = LOOKS.values()
    assert len({look["color"] for look in looks}) == len(looks)
    assert len({str(look["linestyle"]) for look in looks}) == len(looks)


@given(st.text())
def test_what_stands_beside_an_axis_fits_and_is_something_that_xml_can_hold(name):
    short = shorten_name(name)
    assert len(short) <= LONGEST_NAME
    element = ET.Element("text")
    element.text = short
    assert (ET.fromstring(ET.tostring(element)).text or "") == short
